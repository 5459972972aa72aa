#ifndef PHI_FILE_NEWTON_LINEARISED
#define PHI_FILE_NEWTON_LINEARISED
#include <math.h>
#include <string.h>
#include "newton_lanes.c"

/* Evaluate a stage at the points y; matrices = 1 computes new matrices, 0 keeps those of the last iteration. */
static void phi_update(phi_lanes coef[restrict], phi_model *model, int matrices)
{
    if (matrices) phi_linearise_stage(coef, model);
    else phi_evaluate_lanes(coef, model->y, model->displacement, model->increment);
}
#endif
