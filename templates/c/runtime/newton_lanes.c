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

/* A stage in all lanes, linearised around y. */
typedef struct {
    phi_lanes y[PHI_DIM], displacement[PHI_DIM], increment[PHI_DIM], residual[PHI_DIM];
#if PHI_SPARSE
    /* of the Jacobian of alpha(y); that of the increment; what corrections take from the increment */
    phi_lanes factor[PHI_FACTORS], slope[PHI_DIM * PHI_DIM], gained[PHI_DIM];
#elif PHI_CENTRED
    phi_lanes inverse[PHI_DIM * PHI_DIM]; /* a residual r of alpha(y) = x takes inverse r from y */
#else
    /* a residual r of alpha(y) = x takes inverse r from y, and gain r from the increment */
    phi_lanes inverse[PHI_DIM * PHI_DIM], gain[PHI_DIM * PHI_DIM];
#endif
#if PHI_PATH
    phi_lanes middle[PHI_DIM]; /* of the path, less y */
    phi_lanes alpha_y[PHI_DIM * PHI_DIM], increment_y[PHI_DIM * PHI_DIM]; /* of alpha and beta - alpha, with p held fixed */
#endif
} phi_model;

#if PHI_COMPOSED
/* What makes of corrections of y, which are as small as matrices are kept for, their sizes as in phi_size, or larger: by the
   least that a component is in so many stages. */
static void phi_measure(const phi_model *model, int stages, phi_lanes unit[restrict PHI_DIM])
#else
/* What makes of corrections of y, which are as small as matrices are kept for, their sizes as in phi_size. */
static void phi_measure(const phi_model *model, phi_lanes unit[restrict PHI_DIM])
#endif
{
    phi_lanes norm = { 0.0 };
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) unit[i][lane] = fabs(model->y[i][lane]);
#if PHI_COMPOSED
        for (int stage = 1; stage < stages; ++stage) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) {
                const double here = fabs(model[stage].y[i][lane]);
                unit[i][lane] = here < unit[i][lane] ? here : unit[i][lane];
            }
        }
#endif
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

/* Take a correction from y; its size, summed over the components. */
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

#if PHI_SPARSE
/* Correct y by the residuals, with the factors of its matrix, and measure the corrections; also find what they take from
   the increments. */
static void phi_correct(phi_model *model, phi_lanes unit[restrict PHI_DIM], phi_lanes size)
{
    phi_lanes delta[PHI_DIM];
    phi_substitute_lanes(model->factor, model->slope, model->residual, delta, model->gained);
    phi_take(model, delta, unit, size);
}

#else
/* The product of a matrix and a vector. */
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

/* What a residual takes from the increment. */
static void phi_gain(phi_model *model, phi_lanes residual[restrict PHI_DIM], phi_lanes gained[restrict PHI_DIM])
{
#if PHI_CENTRED
    phi_apply(model->inverse, residual, gained);
    for (int i = 0; i < PHI_DIM; ++i) { /* y is the mean of the ends, alpha and beta */
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) gained[i][lane] = 2.0 * (gained[i][lane] - residual[i][lane]);
    }
#else
    phi_apply(model->gain, residual, gained);
#endif
}

/* Correct y by the residuals, with the inverse of its matrix, and measure the corrections. */
static void phi_correct(phi_model *model, phi_lanes unit[restrict PHI_DIM], phi_lanes size)
{
    phi_lanes delta[PHI_DIM];
    phi_apply(model->inverse, model->residual, delta);
    phi_take(model, delta, unit, size);
}

#endif
/* Corrections below the first go on with the matrices of the last pass. After the square of so small a correction as the
   second, there is rounding only, if the next is below the third. */
#define PHI_FROZEN 1e-4
#define PHI_SMALL 1e-8
#define PHI_BLOCK_ROUNDING 1e-10
#define PHI_CAUTION 32.0 /* frozen matrices leave twice what new ones did, of the same correction; this is far more */

/* What corrections of this size leave, after those of the size before: the first leave their square, later ones the part of
   themselves that they are of those before, or less. Nothing, where all that is left is rounding. */
static void phi_leave(const phi_lanes size, const phi_lanes before, phi_lanes left)
{
    PHI_EACH_LANE
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        const double part = before[lane] < HUGE_VAL ? PHI_CAUTION * size[lane] / before[lane] : size[lane];
        left[lane] = before[lane] < PHI_SMALL && size[lane] < PHI_BLOCK_ROUNDING ? 0.0 : part * size[lane];
    }
}

#if PHI_PATH
#include "path_lanes.c"
#else
#if PHI_SPARSE
/* Linearise a stage around the points y. The matrices are I + O(h): where a pivot is far from 1, all is infinite. */
static void phi_linearise_stage(phi_lanes coef[restrict], phi_model *model)
{
    phi_lanes matrix[PHI_DIM * PHI_DIM], bad = { 0.0 };
    phi_linearise_lanes(coef, model->y, model->displacement, model->increment, matrix, model->slope);
    phi_factorise_lanes(matrix, model->factor);
    for (int k = 0; k < PHI_DIM; ++k) { /* the reciprocals of the pivots */
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane)
            bad[lane] += fabs(model->factor[k][lane]) < PHI_LARGEST_RECIPROCAL ? 0.0 : HUGE_VAL;
    }
    for (int lane = 0; lane < PHI_LANES; ++lane) model->factor[0][lane] += bad[lane];
}

#elif PHI_INVERSE_UNROLLED
/* Linearise a stage around the points y. The matrices are I + O(h): where a pivot is far from 1, all is infinite. */
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

#else
/* Invert the matrices of all lanes in place by elimination without pivoting: they are I + O(h). Infinite where a pivot is
   far from 1. */
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

/* Linearise a stage around the points y. */
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
/* Evaluate a stage at the points y, with its matrices or with those of the last pass. */
static void phi_update(phi_lanes coef[restrict], phi_model *model, int matrices)
{
    if (matrices) phi_linearise_stage(coef, model);
    else phi_evaluate_lanes(coef, model->y, model->displacement, model->increment);
}

#endif
#endif
