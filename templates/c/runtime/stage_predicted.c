#ifndef PHI_FILE_STAGE_PREDICTED
#define PHI_FILE_STAGE_PREDICTED
#include <string.h>

#include "model.h"
#include "newton.c"
#include "path.c"
#include "gauss.c"

/* Make one stage; in a Gauss step, all stages. If a prediction makes the iteration fail, start without it. */
static phi_status phi_stage(phi_solver *s PHI_AND_INT_STAGE)
{
    const phi_status status = phi_attempt(s PHI_AND_STAGE);
    if (status == PHI_OK || PHI_OF(s->history, stage).count == 0) return status;
    memset(&PHI_OF(s->history, stage), 0, sizeof PHI_OF(s->history, stage));
    return phi_attempt(s PHI_AND_STAGE);
}
#endif
