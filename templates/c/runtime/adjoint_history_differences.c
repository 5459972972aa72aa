#ifndef PHI_FILE_ADJOINT_HISTORY_DIFFERENCES
#define PHI_FILE_ADJOINT_HISTORY_DIFFERENCES
#include <string.h>

#include "adjoint_stage.c"

#define PHI_AT_ONCE ((size_t)1) /* number of steps after which their solutions are read from the predictor */

/* Copy the last solution of a stage from its predictor to the tape. Returns 0 if steps > 1: the predictor stores no
   earlier solutions. */
static int phi_read_history(const phi_history *history, size_t steps PHI_AND_INT_STAGE, phi_step_tape *tape)
{
    if (steps > 1) return 0;
    memcpy(PHI_OF(tape[0], stage), history->difference[0], PHI_DIM * sizeof(double));
    return 1;
}
#endif
