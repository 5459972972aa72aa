#ifndef PHI_FILE_ADJOINT_GATHER
#define PHI_FILE_ADJOINT_GATHER
#include "adjoint_lanes.c"

/* Add the cotangents of the coefficients in a lane to coef_bar, unless the stage in this lane could not be linearised.
   */
static void phi_gather(phi_traced *g, phi_lanes slopes[PHI_COEFFICIENTS], int lane, double coef_bar[PHI_COEFFICIENTS])
{
    if (g->wrong[lane] != 0.0) return;
    for (int k = 0; k < PHI_COEFFICIENTS; ++k) coef_bar[k] += slopes[k][lane];
}
#endif
