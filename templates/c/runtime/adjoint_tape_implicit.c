#ifndef PHI_FILE_ADJOINT_TAPE_IMPLICIT
#define PHI_FILE_ADJOINT_TAPE_IMPLICIT
#include "adjoint.c"
#include "adjoint_history_recurrences.c"
#include "adjoint_history_differences.c"

/* Write the tape of the last steps, from the solutions stored by the predictors. Returns 0 if they do not store all of
   them. */
static int phi_remembered(const phi_solver *s, size_t steps, phi_step_tape *tape)
{
    PHI_EACH_STAGE
        if (!phi_read_history(&PHI_OF(s->history, stage), steps PHI_AND_STAGE, tape)) return 0;
    return 1;
}

/* Make steps and write their tape. On failure *s is unchanged. */
static phi_status phi_record_steps(phi_solver *s, size_t steps, phi_step_tape *tape)
{
    const phi_solver before = *s;
    phi_status status = phi_integrate(s, s->h, steps);
    if (status == PHI_OK && !phi_remembered(s, steps, tape)) { /* a step has reset its predictor */
        *s = before;
        for (size_t k = 0; k < steps && status == PHI_OK; ++k) {
            status = phi_step(s, s->h);
            if (status == PHI_OK && !phi_remembered(s, 1, tape + k)) status = PHI_NO_CONVERGENCE;
        }
    }
    if (status != PHI_OK) *s = before;
    return status;
}
#endif
