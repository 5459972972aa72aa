#ifndef PHI_FILE_ADJOINT_STAGES
#define PHI_FILE_ADJOINT_STAGES
#include "adjoint_stage.c"

/* Pull the cotangent *bar back through a step, by the tape of its stages. */
static phi_status phi_stages_adjoint(const phi_solver *s, phi_step_tape tape, phi_cotangent *bar)
{
    phi_status status = PHI_OK;
    PHI_EACH_STAGE_BACK
        if (status == PHI_OK) status = phi_stage_adjoint(PHI_OF(s->coef, stage), PHI_OF(tape, stage), bar, PHI_OF(bar->coef, stage));
    return status;
}
#endif
