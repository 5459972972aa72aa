#ifndef PHI_FILE_ADJOINT_NEWTON_CENTRED
#define PHI_FILE_ADJOINT_NEWTON_CENTRED
#include <string.h>

#include "adjoint_lanes.c"

/* Linearise the stages in all lanes at their solutions y. */
static void phi_linearise_back(phi_traced *g)
{
    phi_lanes displacement[PHI_DIM], increment[PHI_DIM], jacobian[PHI_DIM * PHI_DIM];
    phi_linearise_lanes(g->coef, g->y, displacement, increment, jacobian);
    memset(g->wrong, 0, sizeof g->wrong);
    for (int i = 0; i < PHI_DIM; ++i)
        for (int j = 0; j < PHI_DIM; ++j) {
            const int to = i * PHI_DIM + j, from = j * PHI_DIM + i;
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) {
                g->jacobian[to][lane] = jacobian[from][lane];
                g->gain[to][lane] = 2.0 * ((i == j ? 1.0 : 0.0) - jacobian[from][lane]); /* y is the mean of start and end */
            }
        }
}
#endif
