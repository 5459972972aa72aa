#ifndef PHI_FILE_NEWTON_UNROLLED
#define PHI_FILE_NEWTON_UNROLLED
#include <math.h>
#include <string.h>
#include "newton_lanes.c"

/* Linearise a stage around the points y. The matrices are I + O(h): a pivot below 1/PHI_LARGEST_RECIPROCAL is a failure,
   and makes the results of its lane infinite. */
static void phi_linearise_stage(phi_lanes coef[restrict], phi_model *model)
{
    phi_lanes jacobian[PHI_DIM * PHI_DIM], reciprocal[PHI_DIM];
#if PHI_CENTRED
    phi_linearise_lanes(coef, model->y, model->displacement, model->increment, jacobian);
    phi_invert_lanes(jacobian, model->inverse, reciprocal);
#else
    phi_lanes slope[PHI_DIM * PHI_DIM];
    phi_linearise_lanes(coef, model->y, model->displacement, model->increment, jacobian, slope);
    phi_invert_lanes(jacobian, slope, model->inverse, model->gain, reciprocal);
#endif
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane)
            model->inverse[i][lane] += fabs(reciprocal[i][lane]) < PHI_LARGEST_RECIPROCAL ? 0.0 : HUGE_VAL;
    }
}
#endif
