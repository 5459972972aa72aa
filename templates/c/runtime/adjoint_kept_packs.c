#ifndef PHI_FILE_ADJOINT_KEPT_PACKS
#define PHI_FILE_ADJOINT_KEPT_PACKS
#include <string.h>

#include "adjoint_kept.c"

/* Make a step, of as many as remain, and leave the points of its stages; the end of what was left. NULL where too few
   members are left to go on. */
static double *phi_pull_step(phi_group *group, size_t remaining, double *trail)
{
    (void)remaining;
    PHI_EACH_STAGE
        for (int k = 0; k < group->packs; ++k) {
            memcpy(trail, group->pack[k].x, PHI_POINT * sizeof *trail);
            trail += PHI_POINT;
            phi_stage_lanes(PHI_OF(group->coef[k], stage), 1, &group->pack[k]);
        }
    return trail;
}
#endif
