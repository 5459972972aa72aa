#ifndef PHI_FILE_ADJOINT_BATCHES
#define PHI_FILE_ADJOINT_BATCHES
#include <string.h>

#include "adjoint_members.c"
#include "groups.c"
#include "batches.c"
#include "model.h"
#include "solver.c"

/* ---- Gradients of SIMD batches of members ---- */
/* A batch of the reverse pass has PHI_BACK_PACKS vectors, with one member of the ensemble in each lane. */
enum { PHI_BACK_GROUP = (int)PHI_BACK_PACKS * PHI_LANES };

#include "adjoint_segment.h"

/* Derivatives of a number L by state, coefficients and parameters, with one member of the ensemble in each lane. */
typedef struct {
#include "state_of_back_group.h"
} phi_back_group;

/* Add `more` to `sum`, lane by lane. */
static inline void phi_gain_lanes(double sum[restrict PHI_LANES], const double more[restrict PHI_LANES])
{
    PHI_EACH_LANE
    for (int lane = 0; lane < PHI_LANES; ++lane) sum[lane] += more[lane];
}

#include "adjoint_join_groups.c"
#include "adjoint_join_batches.c"

/* If the states after `done` steps are an output row, write the states of the members to it. */
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
