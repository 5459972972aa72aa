#ifndef PHI_FILE_ADJOINT_LANES
#define PHI_FILE_ADJOINT_LANES
#include <math.h>
#include <string.h>

#include "adjoint_stage.c"
#include "expansion_lanes.c"
#include "model.h"
#include "model_lanes.h"
#include "solver.c"

/* ---- Reverse pass, vectorised over stages ---- */
/* The tape gives the points at which stages are linearised, before any cotangent is known. So the derivatives of several
   stages are computed together, one in each lane. Then the cotangent is pulled back through the stages one after the
   other, by a product with a small matrix for each. */

/* Linearised stages, one in each lane. jacobian and gain are the transposes of the derivatives of alpha(y) and of the
   increment. The cotangent `after` at the end of a stage becomes after + change, where jacobian change = gain after.
   wrong is infinite in lanes where elimination without pivoting fails. */
typedef struct {
#include "state_of_traced.h"
} phi_traced;

/* Solve `matrix` * X = `sides` by elimination without pivoting: matrices are I + O(h). `sides` receives the solutions
   X, and `matrix` is overwritten. `count` is the number of columns of `sides`. `wrong` becomes infinite in lanes where
   a pivot is far from 1. */
static void phi_solve_lanes(phi_lanes *matrix, phi_lanes *sides, int count, phi_lanes wrong)
{
    for (int k = 0; k < PHI_DIM; ++k) {
        phi_lanes reciprocal, factor;
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            reciprocal[lane] = 1.0 / matrix[k * PHI_DIM + k][lane];
            wrong[lane] += fabs(reciprocal[lane]) < PHI_LARGEST_RECIPROCAL ? 0.0 : HUGE_VAL;
        }
        for (int j = k + 1; j < PHI_DIM; ++j) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) matrix[k * PHI_DIM + j][lane] *= reciprocal[lane];
        }
        for (int j = 0; j < count; ++j) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) sides[k * count + j][lane] *= reciprocal[lane];
        }
        for (int i = 0; i < PHI_DIM; ++i) {
            if (i == k) continue;
            memcpy(factor, matrix[i * PHI_DIM + k], sizeof factor);
            for (int j = k + 1; j < PHI_DIM; ++j) {
                PHI_EACH_LANE
                for (int lane = 0; lane < PHI_LANES; ++lane)
                    matrix[i * PHI_DIM + j][lane] -= factor[lane] * matrix[k * PHI_DIM + j][lane];
            }
            for (int j = 0; j < count; ++j) {
                PHI_EACH_LANE
                for (int lane = 0; lane < PHI_LANES; ++lane)
                    sides[i * count + j][lane] -= factor[lane] * sides[k * count + j][lane];
            }
        }
    }
}

#include "adjoint_newton_lanes.c"
#include "adjoint_path_lanes.c"

/* Load one stage of a step into a lane: y is the solution of the stage on the tape, and *at is the solver after the
   step. */
static void phi_load(phi_traced *g, int lane, const phi_solver *at PHI_AND_INT_STAGE, const double y[PHI_DIM])
{
    for (int i = 0; i < PHI_DIM; ++i) g->y[i][lane] = y[i];
    for (int k = 0; k < PHI_COEFFICIENTS; ++k) g->coef[k][lane] = PHI_OF(at->coef, stage)[k];
    PHI_NOTE_TIME_OF_LANE(g, at)
}

/* Pull a cotangent back through the linearised stage in a lane. If its elimination failed, the stage is linearised again,
   with pivoting. */
static phi_status phi_through(phi_traced *g, int lane, phi_cotangent *bar, double coef_bar[PHI_COEFFICIENTS])
{
    double change[PHI_DIM] = { 0.0 };
    phi_status status = PHI_OK;
    for (int i = 0; i < PHI_DIM; ++i)
        for (int j = 0; j < PHI_DIM; ++j) change[i] += g->gain[i * PHI_DIM + j][lane] * bar->x[j];
    for (int i = 0; i < PHI_DIM; ++i)
        if (!isfinite(change[i])) g->wrong[lane] = HUGE_VAL;
    const int good = g->wrong[lane] == 0.0;
    for (int i = 0; i < PHI_DIM; ++i) {
        g->after[i][lane] = good ? bar->x[i] : 0.0;
        g->change[i][lane] = good ? change[i] : 0.0;
    }
    if (good) {
        for (int i = 0; i < PHI_DIM; ++i) {
            bar->x[i] += change[i];
            PHI_NOTE_START(bar, g)
        }
    } else {
        double coef[PHI_COEFFICIENTS], y[PHI_DIM];
        for (int k = 0; k < PHI_COEFFICIENTS; ++k) coef[k] = g->coef[k][lane];
        for (int i = 0; i < PHI_DIM; ++i) y[i] = g->y[i][lane];
        status = phi_stage_adjoint(coef, y, bar, coef_bar);
        phi_early(coef, coef_bar, g->t[lane]);
    }
    return status;
}

#include "adjoint_gather.c"
#include "adjoint_gather_early.c"
#endif
