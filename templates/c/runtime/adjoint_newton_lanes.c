#ifndef PHI_FILE_ADJOINT_NEWTON_LANES
#define PHI_FILE_ADJOINT_NEWTON_LANES
#include <math.h>
#include <string.h>
#include "adjoint_lanes.c"

/* Linearise the stages. */
static void phi_linearise_back(phi_traced *g)
{
    phi_lanes displacement[PHI_DIM], increment[PHI_DIM], jacobian[PHI_DIM * PHI_DIM];
#if PHI_CENTRED
    phi_linearise_lanes(g->coef, g->y, displacement, increment, jacobian);
#else
    phi_lanes slope[PHI_DIM * PHI_DIM];
#if PHI_SPARSE
    memset(jacobian, 0, sizeof jacobian); /* zeros are not stored */
    memset(slope, 0, sizeof slope);
#endif
    phi_linearise_lanes(g->coef, g->y, displacement, increment, jacobian, slope);
#endif
    memset(g->wrong, 0, sizeof g->wrong);
    for (int i = 0; i < PHI_DIM; ++i)
        for (int j = 0; j < PHI_DIM; ++j) {
            const int to = i * PHI_DIM + j, from = j * PHI_DIM + i;
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) {
                g->jacobian[to][lane] = jacobian[from][lane];
#if PHI_CENTRED
                g->gain[to][lane] = 2.0 * ((i == j ? 1.0 : 0.0) - jacobian[from][lane]); /* y is the mean of the ends */
#else
                g->gain[to][lane] = slope[from][lane];
#endif
            }
        }
}

/* The cotangents of coefficients, from those of ends and of residuals. */
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
