#ifndef PHI_FILE_ADJOINT_NEWTON_LANES
#define PHI_FILE_ADJOINT_NEWTON_LANES
#include <math.h>
#include <string.h>
#include "adjoint_lanes.c"

#include "adjoint_newton_centred.c"
#include "adjoint_newton_general.c"

/* Compute the cotangents of the coefficients of all stages from the cotangents of the ends of the stages and of the
   residuals of their equations. */
static void phi_slopes_back(phi_traced *g, phi_lanes slopes[restrict PHI_COEFFICIENTS])
{
    phi_lanes minus[PHI_DIM];
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) minus[i][lane] = -g->change[i][lane];
    }
    phi_linearise_adjoint_lanes(g->coef, g->y, minus, g->after, slopes);
}
#endif
