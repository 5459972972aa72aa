#ifndef PHI_FILE_ADJOINT_TAPE_FLOWS
#define PHI_FILE_ADJOINT_TAPE_FLOWS
#include "adjoint.c"

phi_status phi_integrate(phi_solver *s, double h, size_t steps) { return phi_integrate_recording(s, h, steps, NULL); }

#define PHI_AT_ONCE ((size_t)-1) /* flows write the tape while steps are made, for any number of steps */

/* Make steps and write their tape. On failure *s is unchanged. */
static phi_status phi_record_steps(phi_solver *s, size_t steps, phi_step_tape *tape)
{
    const phi_solver before = *s;
    const phi_status status = phi_integrate_recording(s, s->h, steps, tape[0]);
    if (status != PHI_OK) *s = before;
    return status;
}
#endif
