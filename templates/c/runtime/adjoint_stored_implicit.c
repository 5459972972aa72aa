#ifndef PHI_FILE_ADJOINT_STORED_IMPLICIT
#define PHI_FILE_ADJOINT_STORED_IMPLICIT
#include <math.h>
#include <string.h>
#include "adjoint_stored.c"

/* Pull the cotangents x back through a stage whose solution is g->y. They become infinite in lanes where elimination
   without pivoting fails. */
static void phi_pull_stage(phi_traced *g, phi_lanes x[restrict PHI_DIM], phi_lanes coef_bar[restrict PHI_COEFFICIENTS])
{
    phi_lanes slopes[PHI_COEFFICIENTS];
    phi_linearise_back(g);
    memcpy(g->after, x, sizeof g->after);
    memset(g->change, 0, sizeof g->change);
    for (int i = 0; i < PHI_DIM; ++i)
        for (int j = 0; j < PHI_DIM; ++j) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) g->change[i][lane] += g->gain[i * PHI_DIM + j][lane] * x[j][lane];
        }
    phi_solve_lanes(g->jacobian, g->change, 1, g->wrong);
    for (int i = 0; i < PHI_DIM; ++i) {
        phi_gain_lanes(x[i], g->change[i]);
        phi_gain_lanes(x[i], g->wrong);
    }
    phi_slopes_back(g, slopes);
    for (int c = 0; c < PHI_COEFFICIENTS; ++c) phi_gain_lanes(coef_bar[c], slopes[c]);
}
#endif
