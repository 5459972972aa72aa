#ifndef PHI_FILE_NEWTON_CORRECTED
#define PHI_FILE_NEWTON_CORRECTED
#include <math.h>
#include <string.h>
#include "newton_lanes.c"

/* Compute the product of a matrix and a vector in all lanes. */
static void phi_apply(phi_lanes matrix[restrict PHI_DIM * PHI_DIM], phi_lanes vector[restrict PHI_DIM],
    phi_lanes product[restrict PHI_DIM])
{
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            double sum = matrix[i * PHI_DIM][lane] * vector[0][lane];
            for (int j = 1; j < PHI_DIM; ++j) sum += matrix[i * PHI_DIM + j][lane] * vector[j][lane];
            product[i][lane] = sum;
        }
    }
}

/* Compute the correction of the increment from a residual of the equation for y, in all lanes. */
static void phi_gain(phi_model *model, phi_lanes residual[restrict PHI_DIM], phi_lanes gained[restrict PHI_DIM])
{
#if PHI_CENTRED
    phi_apply(model->inverse, residual, gained);
    for (int i = 0; i < PHI_DIM; ++i) { /* y is the mean of alpha and beta */
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) gained[i][lane] = 2.0 * (gained[i][lane] - residual[i][lane]);
    }
#else
    phi_apply(model->gain, residual, gained);
#endif
}

/* Correct y by its residuals, with the inverse of the Newton matrix. `size` receives the size of the correction in each
   lane. */
static void phi_correct(phi_model *model, phi_lanes unit[restrict PHI_DIM], phi_lanes size)
{
    phi_lanes delta[PHI_DIM];
    phi_apply(model->inverse, model->residual, delta);
    phi_take(model, delta, unit, size);
}
#endif
