#ifndef PHI_FILE_PATH_LANES
#define PHI_FILE_PATH_LANES
#include <math.h>
#include <string.h>

#include "expansion_lanes.c"
#include "model.h"
#include "model_lanes.h"
#include "newton_lanes.c"

/* ---- Blocks along paths ---- */
#define PHI_SLOPE_ACCURACY 1e-7 /* relative accuracy of the derivatives of paths */
#define PHI_MIDDLES_SETTLED 1e-9 /* relative accuracy of the middles of paths; Newton iterations remove the remaining error */
#define PHI_PREDICTION_ACCURACY 1e-6 /* relative accuracy of paths in predictions; predictions have larger errors anyway */

/* Compute alpha - y (displacement) and beta - alpha (increment) to leading order, from short Taylor series of paths with the
   middle y. */
static void phi_evaluate_lanes(phi_lanes coef[restrict], phi_lanes y[restrict PHI_DIM],
    phi_lanes displacement[restrict PHI_DIM], phi_lanes increment[restrict PHI_DIM])
{
    phi_expansion e;
    phi_momentum_lanes(coef, y, e.p);
    phi_halve(e.p);
    phi_begin(coef, &e, y);
    phi_extend(coef, &e, PHI_PREDICTION_ACCURACY);
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            displacement[i][lane] = (e.even[i][lane] - e.odd[i][lane]) - e.mean[i][lane];
            increment[i][lane] = 2.0 * e.odd[i][lane];
        }
    }
}

/* Compute alpha - y (displacement) and beta - alpha (increment) from the Taylor series of paths. The mean of a path
   differs a little from y; the results are corrected to first order in this difference. */
static void phi_read_ends(phi_model *model, phi_expansion *e, const phi_lanes wrong)
{
    phi_lanes miss[PHI_DIM];
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            miss[i][lane] = model->middle[i][lane] + e->mean[i][lane];
            model->displacement[i][lane] = ((model->middle[i][lane] + e->even[i][lane]) - e->odd[i][lane]) + wrong[lane];
            model->increment[i][lane] = 2.0 * e->odd[i][lane];
            model->middle[i][lane] = -e->mean[i][lane];
        }
    }
    for (int i = 0; i < PHI_DIM; ++i)
        for (int j = 0; j < PHI_DIM; ++j) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) {
                model->displacement[i][lane] -= model->alpha_y[i * PHI_DIM + j][lane] * miss[j][lane];
                model->increment[i][lane] -= model->increment_y[i * PHI_DIM + j][lane] * miss[j][lane];
            }
        }
}

/* Compute the Newton matrices of a stage from the derivatives of the paths and from the Hessian of the generating function
   S_h. Seven digits suffice, since the error of an accepted correction is then below rounding. */
static void phi_linearise_paths(phi_lanes coef[restrict], phi_model *model, phi_expansion *e,
    phi_lanes hessian[restrict PHI_DIM * PHI_DIM])
{
    phi_lanes jacobian[PHI_DIM * PHI_DIM], slope[PHI_DIM * PHI_DIM], reciprocal[2 * PHI_DIM];
    phi_vary(coef, e, PHI_SLOPE_ACCURACY);
    phi_along_mean_lanes(e->v_even, e->v_odd, e->v_mean, hessian, model->alpha_y, model->increment_y, jacobian,
        slope, reciprocal);
    phi_invert_lanes(jacobian, slope, model->inverse, model->gain, reciprocal + PHI_DIM);
    for (int i = 0; i < 2 * PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane)
            model->inverse[i % PHI_DIM][lane] += fabs(reciprocal[i][lane]) < PHI_LARGEST_RECIPROCAL ? 0.0 : HUGE_VAL;
    }
}

/* Evaluate a stage at the points y; matrices = 1 computes new matrices, 0 keeps those of the last iteration. */
static void phi_update(phi_lanes coef[restrict], phi_model *model, int matrices)
{
    phi_expansion e;
    phi_lanes hessian[PHI_DIM * PHI_DIM], wrong = { 0.0 };
    if (matrices) phi_curvature_lanes(coef, model->y, e.p, hessian);
    else phi_momentum_lanes(coef, model->y, e.p);
    phi_halve(e.p);
    if (matrices) phi_find_middles(coef, model->y, model->middle, &e, PHI_MIDDLES_SETTLED);
    else phi_begin_at(coef, model->y, model->middle, &e);
    phi_extend(coef, &e, PHI_NEGLIGIBLE);
    phi_check_ends(coef, &e, wrong);
    if (matrices) phi_linearise_paths(coef, model, &e, hessian);
    phi_read_ends(model, &e, wrong);
}
#endif
