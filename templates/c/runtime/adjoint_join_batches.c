#ifndef PHI_FILE_ADJOINT_JOIN_BATCHES
#define PHI_FILE_ADJOINT_JOIN_BATCHES
#include "adjoint_batches.c"

/* Initialise a lane with a member at its initial state. Returns 0 if the member cannot start. */
static int phi_pull_join(phi_group *group, int m, const phi_pulled *all, size_t first)
{
    const int lane = m % PHI_LANES, k = m / PHI_LANES;
    phi_solver s;
    phi_status status = phi_pull_begin(all, first + (size_t)m, &s);
    if (status == PHI_OK) status = phi_integrate(&s, all->h[first + (size_t)m], 0);
    if (status != PHI_OK) return 0;
    for (int i = 0; i < PHI_DIM; ++i) group->pack[k].x[i][lane] = s.x[i];
    PHI_EACH_STAGE
        for (int c = 0; c < PHI_COEFFICIENTS; ++c) PHI_OF(group->coef[k], stage)[c][lane] = PHI_OF(s.coef, stage)[c];
    group->active[m] = 1;
    return 1;
}

/* Read the state of a member from its lane. */
static void phi_pull_state(const phi_group *group, int m, double x[PHI_DIM])
{
    for (int i = 0; i < PHI_DIM; ++i) x[i] = group->pack[m / PHI_LANES].x[i][m % PHI_LANES];
}
#endif
