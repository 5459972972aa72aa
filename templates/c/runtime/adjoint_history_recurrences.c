#ifndef PHI_FILE_ADJOINT_HISTORY_RECURRENCES
#define PHI_FILE_ADJOINT_HISTORY_RECURRENCES
#include <string.h>

#include "adjoint_stage.c"

#define PHI_AT_ONCE ((size_t)PHI_REMEMBERED) /* number of steps after which their solutions are read from the predictor */

/* Copy the solutions of a stage in the last steps from its predictor to the tape. Returns 0 if the predictor stores
   too few solutions. */
static int phi_read_history(const phi_history *history, size_t steps PHI_AND_INT_STAGE, phi_step_tape *tape)
{
    const size_t count = (size_t)history->count;
    if (count < steps) return 0;
    for (size_t k = 0; k < steps; ++k) memcpy(PHI_OF(tape[k], stage), history->past[count - steps + k], PHI_DIM * sizeof(double));
    return 1;
}
#endif
