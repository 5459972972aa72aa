#ifndef PHI_FILE_ADJOINT_TAPE_EXPLICIT
#define PHI_FILE_ADJOINT_TAPE_EXPLICIT
#include <string.h>

#include "adjoint.c"
#include "adjoint_starts.c"

#define PHI_AT_ONCE ((size_t)1) /* the tape holds the state before each step */

/* Make a step and write its tape. On failure *s is unchanged. */
static phi_status phi_record_steps(phi_solver *s, size_t steps, phi_step_tape *tape)
{
    const phi_solver before = *s;
    const phi_status status = phi_integrate(s, s->h, steps);
    memcpy(PHI_OF(tape[0], 0), before.x, sizeof before.x);
    phi_find_starts(s, tape[0]);
    if (status != PHI_OK) *s = before;
    return status;
}
#endif
