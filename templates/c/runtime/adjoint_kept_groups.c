#ifndef PHI_FILE_ADJOINT_KEPT_GROUPS
#define PHI_FILE_ADJOINT_KEPT_GROUPS
#include <string.h>

#include "adjoint_kept.c"

/* Make one step of all active members and write the points of its stages to the tape. Returns the end of what was
   written, or NULL if too few members remain active. */
static double *phi_pull_step(phi_group *group, size_t remaining, double *trail)
{
    if (phi_group_step(group, remaining) < PHI_FEWEST) return NULL;
    PHI_EACH_STAGE {
        memcpy(trail, phi_group_past(group PHI_AND_STAGE, 0), PHI_POINT * sizeof *trail);
        trail += PHI_POINT;
    }
    return trail;
}
#endif
