#ifndef PHI_FILE_ADJOINT_ABREAST
#define PHI_FILE_ADJOINT_ABREAST
#include <string.h>

#include "adjoint_members.c"
#include "groups.c"
#include "packs.c"
#include "model.h"
#include "solver.c"

/* ---- Gradients of groups ---- */
/* Members of an ensemble are gone back through together, one in each lane, as they are integrated. */
#if PHI_SPLITTING
enum {
    PHI_BACK_GROUP = (int)PHI_BACK_PACKS * PHI_LANES,
#if PHI_UNDONE
    PHI_SEGMENT = 16 + (2 * PHI_BACK_GROUP + PHI_FLOWS - 1) / PHI_FLOWS /* steps; so the trail of one member suffices for all */
#else
    PHI_SEGMENT = (2 * PHI_BACK_GROUP + PHI_FLOWS - 1) / PHI_FLOWS /* steps; so the trail of one member suffices for all */
#endif
};

#if PHI_UNDONE
/* What is pulled back, as in phi_cotangent; the packs at their starts. */
#else
/* What is pulled back, as in phi_cotangent; the packs at their starts, and the states before the flows of a segment. */
#endif
typedef struct {
    phi_lanes x[PHI_BACK_PACKS][PHI_DIM], coef[PHI_BACK_PACKS][PHI_COEFFICIENTS];
    phi_pack start[PHI_BACK_PACKS];
#if !PHI_UNDONE
    phi_lanes kept[PHI_SEGMENT][PHI_FLOWS][PHI_BACK_PACKS][PHI_DIM];
#endif
} phi_back_group;
#else
enum { PHI_BACK_GROUP = (int)PHI_BACK_PACKS * PHI_LANES };

/* What is pulled back, as in phi_cotangent. */
typedef struct {
    phi_lanes x[PHI_BACK_PACKS][PHI_DIM], PHI_OF(coef[PHI_BACK_PACKS], PHI_STAGES)[PHI_COEFFICIENTS];
} phi_back_group;
#endif

/* Add to a value in all lanes. */
static inline void phi_gain_lanes(double sum[restrict PHI_LANES], const double more[restrict PHI_LANES])
{
    PHI_EACH_LANE
    for (int lane = 0; lane < PHI_LANES; ++lane) sum[lane] += more[lane];
}

/* Put a member at its start into its lane. 0 if it has none. */
static int phi_pull_join(phi_group *group, int m, const phi_pulled *all, size_t first)
{
    const int lane = m % PHI_LANES;
    phi_solver s;
    phi_status status = phi_pull_begin(all, first + (size_t)m, &s);
    if (status == PHI_OK) status = phi_integrate(&s, all->h[first + (size_t)m], 0);
    if (status != PHI_OK) return 0;
#if PHI_GROUPS
    for (int i = 0; i < PHI_DIM; ++i) group->x[i][lane] = s.x[i];
    PHI_EACH_STAGE
        for (int c = 0; c < PHI_COEFFICIENTS; ++c) PHI_OF(group->coef, stage)[c][lane] = PHI_OF(s.coef, stage)[c];
#if PHI_GAUGE
    memcpy(group->gauge[lane], s.gauge, sizeof s.gauge);
#endif
#else
    const int k = m / PHI_LANES;
    for (int i = 0; i < PHI_DIM; ++i) group->pack[k].x[i][lane] = s.x[i];
    PHI_EACH_STAGE
        for (int c = 0; c < PHI_COEFFICIENTS; ++c) PHI_OF(group->coef[k], stage)[c][lane] = PHI_OF(s.coef, stage)[c];
#endif
    group->active[m] = 1;
    return 1;
}

/* Where a member is. */
static void phi_pull_state(const phi_group *group, int m, double x[PHI_DIM])
{
#if PHI_GROUPS
    for (int i = 0; i < PHI_DIM; ++i) x[i] = group->x[i][m];
#else
    for (int i = 0; i < PHI_DIM; ++i) x[i] = group->pack[m / PHI_LANES].x[i][m % PHI_LANES];
#endif
}

/* The rows of members after so many steps, if there are any; their cotangents. */
static void phi_pull_rows(const phi_group *group, int count, const phi_pulled *all, size_t first, size_t done)
{
    const size_t row = (done + all->stride - 1) / all->stride - 1;
    if (all->rows == NULL || (done % all->stride != 0 && done != all->steps)) return;
    for (int m = 0; m < count; ++m)
        phi_pull_state(group, m, all->rows + (first + (size_t)m) * all->each + row * PHI_DIM);
}

static void phi_pull_joined(phi_back_group *bar, int count, const phi_pulled *all, size_t first, size_t done)
{
    const size_t row = (done + all->stride - 1) / all->stride - 1;
    if (done % all->stride != 0 && done != all->steps) return;
    for (int m = 0; m < count; ++m)
        for (int i = 0; i < PHI_DIM; ++i)
            bar->x[m / PHI_LANES][i][m % PHI_LANES] += all->rows_bar[(first + (size_t)m) * all->each + row * PHI_DIM + (size_t)i];
}
#endif
