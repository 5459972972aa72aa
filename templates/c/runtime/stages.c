#ifndef PHI_FILE_STAGES
#define PHI_FILE_STAGES
#include <string.h>

#include "model.h"
#include "explicit_stage.c"
#include "stage_predicted.c"
#include "stage_alone.c"

/* Make the stages of one step. If a stage fails, the state before the step is kept. */
static phi_status phi_stages(phi_solver *s)
{
    phi_status status = PHI_OK;
#include "state_saved.h"
    for (int stage = 0; stage < PHI_STAGES && status == PHI_OK; ++stage) status = phi_stage(s, stage);
    if (status != PHI_OK) {
#include "state_restored.h"
    }
    return status;
}
#endif
