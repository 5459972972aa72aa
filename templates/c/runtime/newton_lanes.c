#ifndef PHI_FILE_NEWTON_LANES
#define PHI_FILE_NEWTON_LANES
#include <float.h>
#include <math.h>
#include <string.h>

#include "algebra.c"
#include "implicit.c"
#include "model.h"
#include "lanes.c"
#include "model_lanes.h"

/* ---- Newton's method in lanes ---- */
#include "measure_policy.h"

/* Linear model of a stage around its points y, in all lanes. */
typedef struct {
#include "state_of_model.h"
} phi_model;

#include "newton_stages.c"

/* Compute the weights of the components of corrections of y: unit[i] = 1 / (|y_i| + PHI_FLOOR times the largest |y_j|). If a
   step has several stages, |y_i| is its smallest value at the stages. */
static void phi_measure(const phi_model *model PHI_AND_INT_STAGES, phi_lanes unit[restrict PHI_DIM])
{
    phi_lanes norm = { 0.0 };
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) unit[i][lane] = fabs(model->y[i][lane]);
        phi_take_least(model, stages, i, unit[i]);
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            const double least = PHI_FLOOR * unit[i][lane];
            norm[lane] = least > norm[lane] ? least : norm[lane];
        }
    }
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) unit[i][lane] = 1.0 / (unit[i][lane] + norm[lane] + DBL_MIN);
    }
}

/* Subtract the correction `delta` from y. `size` receives the weighted sum of |delta_i|, with the weights `unit`. */
static void phi_take(phi_model *model, phi_lanes delta[restrict PHI_DIM], phi_lanes unit[restrict PHI_DIM], phi_lanes size)
{
    memset(size, 0, PHI_LANES * sizeof size[0]);
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            size[lane] += fabs(delta[i][lane]) * unit[i][lane];
            model->y[i][lane] -= delta[i][lane];
        }
    }
}

#include "largest.c"

#include "newton_corrected_sparse.c"
#include "newton_corrected.c"

/* Relative sizes of corrections. After a correction below PHI_FROZEN, the matrices are reused. If a correction is below
   PHI_SMALL, its square is below rounding level; the next correction is then the last one if it is below
   PHI_BLOCK_ROUNDING. */
#define PHI_FROZEN 1e-4
#define PHI_SMALL 1e-8
#define PHI_BLOCK_ROUNDING 1e-10
#define PHI_CAUTION 32.0 /* safety margin, since corrections shrink more slowly with reused matrices than with new ones */

/* Estimate the size of the next correction. `size` is the size of the last correction, `before` that of the correction before it.
   The estimate is size^2 after the first correction, later size * size / before with a safety margin, and 0 at rounding
   level. */
static void phi_leave(const phi_lanes size, const phi_lanes before, phi_lanes left)
{
    PHI_EACH_LANE
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        const double part = before[lane] < HUGE_VAL ? PHI_CAUTION * size[lane] / before[lane] : size[lane];
        left[lane] = before[lane] < PHI_SMALL && size[lane] < PHI_BLOCK_ROUNDING ? 0.0 : part * size[lane];
    }
}

#include "path_lanes.c"
#include "newton_sparse.c"
#include "newton_unrolled.c"
#include "newton_inverted.c"

#include "newton_linearised.c"

#endif
