#ifndef PHI_FILE_ADJOINT_TAPE_GAUSS
#define PHI_FILE_ADJOINT_TAPE_GAUSS
#include <string.h>

#include "adjoint.c"

#define PHI_AT_ONCE ((size_t)1) /* the predictor stores the stage increments of the last step only */

/* Make a step and write its tape. On failure *s is unchanged. */
static phi_status phi_record_steps(phi_solver *s, size_t steps, phi_step_tape *tape)
{
    const phi_solver before = *s;
    const phi_status status = phi_integrate(s, s->h, steps);
    memcpy(tape[0], before.x, sizeof before.x);
#if PHI_FRAMED
    memcpy(tape[0] + PHI_DIM, s->history.solved, sizeof s->history.solved);
#else
    const phi_history *past = &s->history;
    memcpy(tape[0] + PHI_DIM, PHI_LAST_INCREMENTS(past), sizeof PHI_LAST_INCREMENTS(past));
#endif
    if (status != PHI_OK) *s = before;
    return status;
}
#endif
