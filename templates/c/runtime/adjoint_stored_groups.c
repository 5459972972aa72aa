#ifndef PHI_FILE_ADJOINT_STORED_GROUPS
#define PHI_FILE_ADJOINT_STORED_GROUPS
#include <string.h>

#include "adjoint_stored.c"

/* Make one step of all active members and write the points of its stages to the tape. Returns the end of what was
   written, or NULL if too few members remain active. */
static double *phi_pull_step(phi_group *group, size_t remaining, double *tape)
{
    if (phi_group_step(group, remaining) < PHI_FEWEST) return NULL;
    PHI_EACH_STAGE {
        memcpy(tape, phi_group_past(group PHI_AND_STAGE, 0), PHI_POINT * sizeof *tape);
        tape += PHI_POINT;
    }
    return tape;
}
#endif
