#ifndef PHI_FILE_ADJOINT_BACK
#define PHI_FILE_ADJOINT_BACK
#include "adjoint.c"

/* Pull the cotangent *bar back through the step that led to *s, by the tape of the step. *s is set back to the time
   before the step, except for its state. */
static phi_status phi_back_step(phi_solver *s, phi_step_tape tape, phi_cotangent *bar)
{
    phi_rewind(s);
    const phi_status status = PHI_STEP_BACK(s, tape, bar);
    phi_all_early(s, bar);
    return status;
}

/* Pull the cotangent *bar back through the steps that led to *s, by their tape, and add the derivatives by output rows. */
static phi_status phi_back(phi_solver *s, size_t steps, size_t stride, const double *rows_bar,
    phi_step_tape *tape, phi_cotangent *bar)
{
    phi_status status = PHI_OK;
    for (size_t done = steps; done > 0 && status == PHI_OK; --done) {
        phi_join(bar, rows_bar, done, steps, stride);
        PHI_CORRECTOR_AFTER_BACK
        status = phi_back_step(s, tape[done - 1], bar);
        PHI_CORRECTOR_BEFORE_BACK
    }
    return status;
}
#endif
