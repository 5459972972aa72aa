#ifndef PHI_FILE_BLOCKS_PREDICTION
#define PHI_FILE_BLOCKS_PREDICTION
#include <math.h>
#include <string.h>
#include "blocks.c"

/* For each step, model->y holds the mean of its start and its end. Replace this mean by the point y at which (alpha +
   beta)/2 is the mean, to leading order in the step size. */
static void phi_from_means(phi_lanes coef[restrict], phi_model *model)
{
    phi_evaluate_lanes(coef, model->y, model->displacement, model->increment);
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane)
            model->y[i][lane] -= model->displacement[i][lane] + 0.5 * model->increment[i][lane];
    }
}

/* Predict the solutions of a block if recurrences are not used. The steps are first made by the classical Runge-Kutta
   method. Then the predictions are the points at which (alpha + beta)/2 is the mean of start and end of these steps, to
   leading order. */
static void phi_predict_by_march(const phi_solver *s, phi_table *table, phi_model *model)
{
    double x[PHI_DIM], mean[PHI_DIM];
    PHI_BEGIN_OF_STAGES(s)
    memcpy(x, s->x, sizeof x);
    for (int k = 0; k < PHI_ALL_STAGES(PHI_LANES); ++k) {
        const int lane = PHI_STEP_OF(k);
        PHI_TAKE_STAGE_OF(k)
        const double h = PHI_FRACTION(s->h);
        for (int i = 0; i < PHI_DIM; ++i) PHI_IN(model, stage, y)[i][lane] = x[i];
        phi_runge_kutta(s PHI_AND_T(begin), h, x, mean);
        PHI_NEXT_BEGIN(h)
        for (int i = 0; i < PHI_DIM; ++i) PHI_IN(model, stage, y)[i][lane] += 0.5 * h * mean[i];
    }
    PHI_EACH_STAGE phi_from_means(PHI_OF(table->coef, stage), PHI_TO(model, stage));
}
#endif
