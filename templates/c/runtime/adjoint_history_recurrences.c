#ifndef PHI_FILE_ADJOINT_HISTORY_RECURRENCES
#define PHI_FILE_ADJOINT_HISTORY_RECURRENCES
#include <string.h>

#include "adjoint_stage.c"

#define PHI_AT_ONCE ((size_t)PHI_REMEMBERED) /* after so many steps, the solutions of these steps are read from the predictor */

/* Write the solutions of a stage in the last steps to the tape. The predictor of the stage stores solutions; returns 0
   if it stores too few. */
static int phi_read_history(const phi_history *history, size_t steps PHI_AND_INT_STAGE, phi_step_tape *tape)
{
    const size_t count = (size_t)history->count;
    if (count < steps) return 0;
    for (size_t k = 0; k < steps; ++k) memcpy(PHI_OF(tape[k], stage), history->past[count - steps + k], PHI_DIM * sizeof(double));
    return 1;
}
#endif
