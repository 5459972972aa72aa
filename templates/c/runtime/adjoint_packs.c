#ifndef PHI_FILE_ADJOINT_PACKS
#define PHI_FILE_ADJOINT_PACKS
#include <math.h>
#include <string.h>

#include "adjoint_members.c"
#include "model.h"
#include "packs.c"
#include "solver.c"

/* ---- Gradients of packs ---- */
/* Groups are gone back through segment by segment. The states where segments begin are left in the trail; those before
   each flow of a segment are made again, and stay near. */
enum {
    PHI_BACK_GROUP = PHI_BACK_PACKS * PHI_LANES,
    PHI_SEGMENT = (2 * PHI_BACK_GROUP + PHI_FLOWS - 1) / PHI_FLOWS /* steps; so the trail of one member suffices for all */
};

/* What is pulled back, as in phi_cotangent, and the states before the flows of a segment. */
typedef struct {
    phi_lanes x[PHI_BACK_PACKS][PHI_DIM], coef[PHI_BACK_PACKS][PHI_COEFFICIENTS];
    phi_lanes kept[PHI_SEGMENT][PHI_FLOWS][PHI_BACK_PACKS][PHI_DIM];
} phi_back_group;

/* Add to a value in all lanes. */
static inline void phi_gain_lanes(double sum[restrict PHI_LANES], const double more[restrict PHI_LANES])
{
    PHI_EACH_LANE
    for (int lane = 0; lane < PHI_LANES; ++lane) sum[lane] += more[lane];
}

#include "adjoint_flows_lanes.h"

/* Put a member at its start into its lane. 0 if it has none. */
static int phi_pull_join(phi_group *group, int m, const phi_pulled *all, size_t first)
{
    const int k = m / PHI_LANES, lane = m % PHI_LANES;
    phi_solver s;
    phi_status status = phi_pull_begin(all, first + (size_t)m, &s);
    if (status == PHI_OK) status = phi_integrate(&s, all->h[first + (size_t)m], 0);
    if (status != PHI_OK) return 0;
    for (int i = 0; i < PHI_DIM; ++i) group->pack[k].x[i][lane] = s.x[i];
    for (int c = 0; c < PHI_COEFFICIENTS; ++c) group->coef[k][c][lane] = s.coef[c];
    return 1;
}

/* The rows of members after so many steps; their cotangents. */
static void phi_pull_rows(const phi_group *group, int count, const phi_pulled *all, size_t first, size_t done)
{
    const size_t row = (done + all->stride - 1) / all->stride - 1;
    for (int m = 0; m < count && all->rows != NULL; ++m)
        for (int i = 0; i < PHI_DIM; ++i)
            all->rows[(first + (size_t)m) * all->each + row * PHI_DIM + (size_t)i] = group->pack[m / PHI_LANES].x[i][m % PHI_LANES];
}

static void phi_pull_joined(phi_back_group *bar, int count, const phi_pulled *all, size_t first, size_t done)
{
    const size_t row = (done + all->stride - 1) / all->stride - 1;
    for (int m = 0; m < count; ++m)
        for (int i = 0; i < PHI_DIM; ++i)
            bar->x[m / PHI_LANES][i][m % PHI_LANES] += all->rows_bar[(first + (size_t)m) * all->each + row * PHI_DIM + (size_t)i];
}

/* Make all steps, and leave where segments begin, but for the first. */
static void phi_pull_forth(phi_group *group, int count, const phi_pulled *all, size_t first)
{
    double *trail = all->trail;
    for (size_t done = 0; done < all->steps;) {
        const size_t to_row = all->stride - done % all->stride, to_segment = PHI_SEGMENT - done % PHI_SEGMENT;
        size_t until = to_row < to_segment ? to_row : to_segment;
        if (all->steps - done < until) until = all->steps - done;
        for (int k = 0; k < group->packs && done > 0 && done % PHI_SEGMENT == 0; ++k) {
            memcpy(trail, group->pack[k].x, sizeof group->pack[k].x);
            memcpy(trail + PHI_DIM * PHI_LANES, group->pack[k].carry, sizeof group->pack[k].carry);
            trail += 2 * PHI_DIM * PHI_LANES;
        }
        phi_steps_lanes(1, group, (int)until);
        done += until;
        if (done % all->stride == 0 || done == all->steps) phi_pull_rows(group, count, all, first, done);
    }
}

/* Make steps once more, and keep the states before each flow. */
static void phi_pull_again(phi_group *group, int steps, phi_back_group *bar)
{
    for (int step = 0; step < steps; ++step) {
        phi_begin_lanes(group);
        for (int flow = 0; flow < PHI_FLOWS; ++flow) {
            for (int k = 0; k < group->packs; ++k) memcpy(bar->kept[step][flow][k], group->pack[k].x, sizeof group->pack[k].x);
            phi_follow_lanes(phi_flow_part[flow], phi_flow_row[flow], group);
        }
        phi_end_lanes(group);
    }
}

/* Pull the cotangents of rows back through all steps; start has the packs at their starts. */
static void phi_pull_back(phi_group *group, const phi_pack start[PHI_BACK_PACKS], int count, const phi_pulled *all,
    size_t first, phi_back_group *bar)
{
    for (size_t end = all->steps; end > 0;) {
        const size_t begin = (end - 1) / PHI_SEGMENT * PHI_SEGMENT;
        for (int k = 0; k < group->packs; ++k) {
            const size_t place = (begin / PHI_SEGMENT - 1) * (size_t)group->packs + (size_t)k;
            const double *left = all->trail + place * 2 * PHI_DIM * PHI_LANES;
            group->pack[k] = start[k];
            if (begin == 0) continue;
            memcpy(group->pack[k].x, left, sizeof group->pack[k].x);
            memcpy(group->pack[k].carry, left + PHI_DIM * PHI_LANES, sizeof group->pack[k].carry);
        }
        phi_pull_again(group, (int)(end - begin), bar);
        for (; end > begin; --end) {
            if (end % all->stride == 0 || end == all->steps) phi_pull_joined(bar, count, all, first, end);
            for (int flow = PHI_FLOWS - 1; flow >= 0; --flow)
                phi_follow_back_lanes(phi_flow_part[flow], phi_flow_row[flow], group, bar->kept[end - begin - 1][flow], bar);
        }
    }
}

/* What was found for a member. 0 where it has values that are not finite. */
static int phi_pull_end(const phi_back_group *bar, int m, const phi_pulled *all, size_t at)
{
    const int k = m / PHI_LANES, lane = m % PHI_LANES;
    phi_cotangent own;
    for (int i = 0; i < PHI_DIM; ++i) own.x[i] = bar->x[k][i][lane];
    for (int c = 0; c < PHI_COEFFICIENTS; ++c) own.coef[c] = bar->coef[k][c][lane];
    if (!phi_finite(own.x, PHI_DIM) || !phi_finite(own.coef, PHI_COEFFICIENTS)) return 0;
#if PHI_PARAMETERS
    const phi_solver s = { .h = all->h[at], .params = all->params != NULL ? all->params[at] : phi_default_params };
    phi_add_parameters(&s, &own, all->params_bar != NULL ? all->params_bar + at : NULL);
#endif
    memcpy(all->x0_bar + at * PHI_DIM, own.x, sizeof own.x);
    if (all->status != NULL) all->status[at] = PHI_OK;
    return 1;
}

/* The members from first on, as many as a group holds. What lanes cannot do, and what fails, is done once more by single
   members. The first status that is not OK. */
PHI_APART static phi_status phi_pull_group(const phi_pulled *all, size_t first)
{
    phi_group group;
    phi_pack start[PHI_BACK_PACKS];
    phi_back_group bar;
    phi_status result = PHI_OK;
    int good[PHI_BACK_GROUP];
    const int count = all->members - first < PHI_BACK_GROUP ? (int)(all->members - first) : PHI_BACK_GROUP;
    const int together = count > 2; /* fewer are quicker without lanes */
    memset(&group, 0, sizeof group);
    memset(bar.x, 0, sizeof bar.x);
    memset(bar.coef, 0, sizeof bar.coef);
    group.packs = (count + PHI_LANES - 1) / PHI_LANES;
    for (int m = 0; m < count; ++m) good[m] = together && phi_pull_join(&group, m, all, first);
    if (together) {
        memcpy(start, group.pack, sizeof start);
        phi_pull_forth(&group, count, all, first);
        for (int m = 0; m < count; ++m)
            for (int i = 0; i < PHI_DIM; ++i)
                good[m] = good[m] && isfinite(group.pack[m / PHI_LANES].x[i][m % PHI_LANES]);
        phi_pull_back(&group, start, count, all, first, &bar);
    }
    for (int m = 0; m < count; ++m) {
        if (good[m] && phi_pull_end(&bar, m, all, first + (size_t)m)) continue;
        const phi_status status = phi_pull_member(all, first + (size_t)m);
        if (result == PHI_OK) result = status;
    }
    return result;
}
#endif
