#ifndef PHI_FILE_ADJOINT_GATHER_EARLY
#define PHI_FILE_ADJOINT_GATHER_EARLY
#include "adjoint_lanes.c"

/* Add the cotangents of the coefficients in a lane to coef_bar, unless the stage in this lane could not be linearised.
   The cotangents of time-dependent coefficients are first pulled back to the other coefficients. */
static void phi_gather(phi_traced *g, phi_lanes slopes[PHI_COEFFICIENTS], int lane, double coef_bar[PHI_COEFFICIENTS])
{
    if (g->wrong[lane] != 0.0) return;
    double coef[PHI_COEFFICIENTS], bar_of_lane[PHI_COEFFICIENTS];
    for (int k = 0; k < PHI_COEFFICIENTS; ++k) {
        coef[k] = g->coef[k][lane];
        bar_of_lane[k] = slopes[k][lane];
    }
    phi_early(coef, bar_of_lane, g->t[lane]);
    for (int k = 0; k < PHI_COEFFICIENTS; ++k) coef_bar[k] += bar_of_lane[k];
}
#endif
