#ifndef PHI_FILE_ADJOINT_STORED_BATCHES
#define PHI_FILE_ADJOINT_STORED_BATCHES
#include <string.h>

#include "adjoint_stored.c"

/* Make one step of all active members and write the points of its stages to the tape. Returns the end of what was
   written, or NULL if too few members remain active. */
static double *phi_pull_step(phi_group *group, size_t remaining, double *tape)
{
    (void)remaining;
    PHI_EACH_STAGE
        for (int k = 0; k < group->packs; ++k) {
            memcpy(tape, group->pack[k].x, PHI_POINT * sizeof *tape);
            tape += PHI_POINT;
            phi_stage_lanes(PHI_OF(group->coef[k], stage), 1, &group->pack[k]);
        }
    return tape;
}
#endif
