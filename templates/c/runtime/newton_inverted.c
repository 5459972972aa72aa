#ifndef PHI_FILE_NEWTON_INVERTED
#define PHI_FILE_NEWTON_INVERTED
#include <math.h>
#include <string.h>
#include "newton_lanes.c"

/* Replace the matrices in all lanes by their inverses. They are I + O(h), so elimination needs no pivoting; the result is
   infinite in lanes where a pivot is far from 1. */
static void phi_invert(phi_lanes matrix[restrict PHI_DIM * PHI_DIM])
{
    for (int k = 0; k < PHI_DIM; ++k) {
        phi_lanes factor[PHI_DIM];
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            const double reciprocal = 1.0 / matrix[k * PHI_DIM + k][lane];
            matrix[k * PHI_DIM + k][lane] = 1.0;
            for (int j = 0; j < PHI_DIM; ++j) matrix[k * PHI_DIM + j][lane] *= reciprocal;
            matrix[k * PHI_DIM + k][lane] += fabs(reciprocal) < PHI_LARGEST_RECIPROCAL ? 0.0 : HUGE_VAL;
        }
        for (int i = 0; i < PHI_DIM; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) {
                factor[i][lane] = matrix[i * PHI_DIM + k][lane];
                if (i != k) matrix[i * PHI_DIM + k][lane] = 0.0;
            }
        }
        for (int i = 0; i < PHI_DIM; ++i)
            for (int j = 0; j < PHI_DIM && i != k; ++j) {
                PHI_EACH_LANE
                for (int lane = 0; lane < PHI_LANES; ++lane)
                    matrix[i * PHI_DIM + j][lane] -= factor[i][lane] * matrix[k * PHI_DIM + j][lane];
            }
    }
}

/* Linearise a stage around the points y in all lanes. */
static void phi_linearise_stage(phi_lanes coef[restrict], phi_model *model)
{
#if PHI_CENTRED
    phi_linearise_lanes(coef, model->y, model->displacement, model->increment, model->inverse);
    phi_invert(model->inverse);
#else
    phi_lanes slope[PHI_DIM * PHI_DIM];
    phi_linearise_lanes(coef, model->y, model->displacement, model->increment, model->inverse, slope);
    phi_invert(model->inverse);
    for (int i = 0; i < PHI_DIM; ++i)
        for (int j = 0; j < PHI_DIM; ++j) {
            phi_lanes sum = { 0.0 };
            for (int k = 0; k < PHI_DIM; ++k) {
                PHI_EACH_LANE
                for (int lane = 0; lane < PHI_LANES; ++lane)
                    sum[lane] += slope[i * PHI_DIM + k][lane] * model->inverse[k * PHI_DIM + j][lane];
            }
            memcpy(model->gain[i * PHI_DIM + j], sum, sizeof sum);
        }
#endif
}
#endif
