#ifndef PHI_FILE_BATCHES_EXPLICIT
#define PHI_FILE_BATCHES_EXPLICIT
#include <math.h>
#include <string.h>
#include "batches.c"

/* Make one stage, x + increment(x), for a batch of members, in compensated arithmetic. */
PHI_IN_PLACE static inline void phi_stage_lanes(phi_lanes *coef, int distinct_coef, phi_pack *pack)
{
    phi_lanes increment[PHI_DIM];
    phi_explicit_lanes(coef, pack->x, distinct_coef, increment);
    for (int i = 0; i < PHI_DIM; ++i) {
        double *x = pack->x[i], *carry = pack->carry[i];
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            const double change = increment[i][lane], sum = x[lane] + change, added = sum - x[lane];
            const double rest = ((x[lane] - (sum - added)) + (change - added)) + carry[lane];
            x[lane] = sum + rest;
            carry[lane] = rest - (x[lane] - sum);
        }
    }
}

/* Make steps of a group. Each stage is made for all batches before the next stage. With distinct_coef = 0, all members
   have the coefficients of the first lane. */
PHI_IN_PLACE static inline void phi_steps_lanes(int distinct_coef, phi_group *group, int steps)
{
    for (int step = 0; step < steps; ++step)
        PHI_EACH_STAGE
            for (int k = 0; k < group->packs; ++k) phi_stage_lanes(PHI_OF(group->coef[distinct_coef * k], stage), distinct_coef, &group->pack[k]);
}
#endif
