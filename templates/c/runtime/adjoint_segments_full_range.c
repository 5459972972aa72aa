#ifndef PHI_FILE_ADJOINT_SEGMENTS_FULL_RANGE
#define PHI_FILE_ADJOINT_SEGMENTS_FULL_RANGE
#include <string.h>

#include "adjoint_segments.c"

/* Whether all values are finite. */
static int phi_pull_finite(const phi_group *group)
{
    phi_lanes sum = { 0.0 };
    for (int k = 0; k < group->packs; ++k)
        for (int i = 0; i < PHI_DIM; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) sum[lane] += 0.0 * group->pack[k].x[i][lane];
        }
    return phi_finite(sum, PHI_LANES);
}

/* Make steps. If values are not finite afterwards, restore the initial states and return 0; all further steps then use
   functions for arguments of any size. */
static int phi_pull_steps(phi_group *group, int steps, const phi_back_group *bar)
{
    if (group->full_range) phi_steps_full_range_lanes(group, steps);
    else phi_steps_lanes(1, group, steps);
    if (group->full_range || phi_pull_finite(group)) return 1;
    memcpy(group->pack, bar->start, sizeof bar->start);
    group->full_range = 1;
    return 0;
}
#endif
