#ifndef PHI_FILE_ADJOINT_KEPT_GROUPS
#define PHI_FILE_ADJOINT_KEPT_GROUPS
#include <string.h>

#include "adjoint_kept.c"

/* Make a step, of as many as remain, and leave the points of its stages; the end of what was left. NULL where too few
   members are left to go on. */
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
