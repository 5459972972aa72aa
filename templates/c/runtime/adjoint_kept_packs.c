#ifndef PHI_FILE_ADJOINT_KEPT_PACKS
#define PHI_FILE_ADJOINT_KEPT_PACKS
#include <string.h>

#include "adjoint_kept.c"

/* Make one step of all active members and write the points of its stages to the tape. Returns the end of what was
   written, or NULL if too few members remain active. */
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
