#ifndef PHI_FILE_DEVICE_LENT
#define PHI_FILE_DEVICE_LENT
#include "device_solver.h"

/* Assign shared memory to the predictors of a solver, after phi_init. `memory` has PHI_LENT doubles for each of
   PHI_GROUP work items. */
static void phi_lend(phi_solver *s, PHI_SHARED double *memory)
{
    PHI_EACH_STAGE
        PHI_OF(s->history, stage).difference = memory + PHI_LENT_BEFORE * PHI_GROUP + PHI_LANE;
}

#endif
