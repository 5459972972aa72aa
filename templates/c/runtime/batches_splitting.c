#ifndef PHI_FILE_BATCHES_SPLITTING
#define PHI_FILE_BATCHES_SPLITTING
#include <math.h>
#include <string.h>
#include "batches.c"

/* Start a step of all members, before its flows: store x. */
static void phi_begin_lanes(phi_group *group)
{
    for (int k = 0; k < group->packs; ++k) memcpy(group->pack[k].start, group->pack[k].x, sizeof group->pack[k].x);
}

/* End a step of all members, after its flows: add the sum of the increments to the stored x. */
static void phi_end_lanes(phi_group *group)
{
    for (int k = 0; k < group->packs; ++k) {
        phi_pack *pack = &group->pack[k];
        for (int i = 0; i < PHI_DIM; ++i) phi_settle_lanes(pack->x[i], pack->carry[i], pack->start[i]);
    }
}

/* Make steps of a group. Each flow is applied to all batches before the next flow. With distinct_coef = 0, all members
   have the coefficients of the first lane. */
PHI_IN_PLACE static inline void phi_steps_lanes(int distinct_coef, phi_group *group, int steps)
{
    for (int step = 0; step < steps; ++step) {
        phi_begin_lanes(group);
        phi_flows_lanes(0, distinct_coef, group);
        phi_end_lanes(group);
    }
}
#endif
