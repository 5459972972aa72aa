#ifndef PHI_FILE_NEWTON_SPARSE
#define PHI_FILE_NEWTON_SPARSE
#include <math.h>
#include <string.h>
#include "newton_lanes.c"

/* Linearise a stage around the points y. The matrices are I + O(h): a pivot below 1/PHI_LARGEST_RECIPROCAL is a failure,
   and makes the results of its lane infinite. */
static void phi_linearise_stage(phi_lanes coef[restrict], phi_model *model)
{
    phi_lanes matrix[PHI_DIM * PHI_DIM], bad = { 0.0 };
    phi_linearise_lanes(coef, model->y, model->displacement, model->increment, matrix, model->slope);
    phi_factorise_lanes(matrix, model->factor);
    for (int k = 0; k < PHI_DIM; ++k) { /* reciprocals of the pivots */
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane)
            bad[lane] += fabs(model->factor[k][lane]) < PHI_LARGEST_RECIPROCAL ? 0.0 : HUGE_VAL;
    }
    for (int lane = 0; lane < PHI_LANES; ++lane) model->factor[0][lane] += bad[lane];
}
#endif
