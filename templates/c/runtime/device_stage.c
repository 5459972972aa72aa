#ifndef PHI_FILE_DEVICE_STAGE
#define PHI_FILE_DEVICE_STAGE
#include "device_solver.h"

/* Clear the predictor of a stage. */
static void phi_forget(phi_history *history)
{
    history->count = 0;
    PHI_FORGET_ORDER(history)
}

/* Make one stage of a step. If it fails from the predicted solution, repeat it without a prediction. */
static phi_status phi_stage(phi_solver *s PHI_AND_INT_STAGE)
{
    phi_status status = PHI_OK;
    PHI_NO_UNROLL
    for (int attempt = 0; attempt < 2; ++attempt) {
        status = phi_attempt(s PHI_AND_STAGE);
        if (status == PHI_OK || PHI_OF(s->history, stage).count == 0) break;
        phi_forget(&PHI_OF(s->history, stage));
    }
    return status;
}

#endif
