#ifndef PHI_FILE_NEWTON_CORRECTED_SPARSE
#define PHI_FILE_NEWTON_CORRECTED_SPARSE
#include <math.h>
#include <string.h>
#include "newton_lanes.c"

/* Correct y by its residuals, with the factors of the Newton matrix. `size` receives the size of the correction in each
   lane. Also compute the corrections of the increments that the residuals cause. */
static void phi_correct(phi_model *model, phi_lanes unit[restrict PHI_DIM], phi_lanes size)
{
    phi_lanes delta[PHI_DIM];
    phi_substitute_lanes(model->factor, model->slope, model->residual, delta, model->gained);
    phi_take(model, delta, unit, size);
}
#endif
