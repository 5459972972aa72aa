#ifndef PHI_FILE_TANGENT
#define PHI_FILE_TANGENT
#include <float.h>
#include <math.h>
#include <string.h>

#include "algebra.c"
#include "model.h"
#include "solver.c"

/* ---- The tangent map of a step ---- */
#if PHI_PATH
#include "tangent_model.h"
#elif PHI_SPLITTING
#include "tangent_flows.h"
#endif

#if PHI_IMPLICIT
#include "tangent_policy.h"

#endif
#if PHI_PATH
#include "path_tangent_policy.h"

#endif
/* The product of two matrices, into a third. */
static void phi_tangent_product(const double a[PHI_DIM * PHI_DIM], const double b[PHI_DIM * PHI_DIM], double product[PHI_DIM * PHI_DIM])
{
    for (int i = 0; i < PHI_DIM; ++i)
        for (int j = 0; j < PHI_DIM; ++j) {
            double sum = 0.0;
            for (int k = 0; k < PHI_DIM; ++k) sum += a[i * PHI_DIM + k] * b[k * PHI_DIM + j];
            product[i * PHI_DIM + j] = sum;
        }
}

#if PHI_IMPLICIT
/* Whether a solve has reached the level of rounding, by its last two corrections. */
static int phi_tangent_solved(double size, double previous)
{
    const int stalled = size < PHI_TANGENT_NEARLY_SOLVED && size > PHI_TANGENT_SHRINKING * previous;
    return size <= PHI_TANGENT_SOLVED || stalled;
}

/* Solve matrix * solution = sides for all columns of sides, which are overwritten. 0 if singular. */
static int phi_tangent_solve(const double matrix[PHI_DIM * PHI_DIM], double sides[PHI_DIM * PHI_DIM])
{
    for (int j = 0; j < PHI_DIM; ++j) {
        double copy[PHI_DIM * PHI_DIM], side[PHI_DIM];
        memcpy(copy, matrix, sizeof copy);
        for (int i = 0; i < PHI_DIM; ++i) side[i] = sides[i * PHI_DIM + j];
        if (!phi_solve(copy, side)) return 0;
        for (int i = 0; i < PHI_DIM; ++i) sides[i * PHI_DIM + j] = side[i];
    }
    return 1;
}

#endif
#if PHI_EXPLICIT
/* The derivative of one explicit stage, 1 + increment', and its step from x + carry. The remembered value is unused. */
static phi_status phi_tangent_stage(const double *coef, const double x[PHI_DIM], const double carry[PHI_DIM],
    const double value[PHI_DIM], double change[PHI_DIM], double derivative[PHI_DIM * PHI_DIM])
{
    (void)carry;
    (void)value;
    phi_explicit(coef, x, change);
    phi_explicit_tangent(coef, x, derivative);
    for (int i = 0; i < PHI_DIM; ++i) derivative[i * PHI_DIM + i] += 1.0;
    return PHI_OK;
}

#elif PHI_GAUSS
enum { PHI_SLOPES = PHI_UNKNOWNS * (PHI_DIM + PHI_UNKNOWNS) }; /* of a stage, along x and along the unknowns */
#include "gauss_tangent_policy.h"

/* How moves of the stages vary along coordinate j, by sweeps of the linear equations that they satisfy; 0 if these do not
   come to an end. */
static int phi_vary(const phi_solver *s, double slopes[PHI_NODES][PHI_SLOPES], int j, phi_lanes *varied)
{
    phi_lanes z[PHI_UNKNOWNS];
    double previous = HUGE_VAL;
    memset(z, 0, sizeof z);
    for (int sweep = 0; sweep <= PHI_MAX_SWEEPS; ++sweep) {
        double change = 0.0, size = DBL_MIN;
        for (int k = 0; k < PHI_UNKNOWNS; ++k)
            for (int i = 0; i < PHI_NODES; ++i) {
                const double *row = slopes[i] + k * (PHI_DIM + PHI_UNKNOWNS);
                double sum = row[j];
                for (int l = 0; l < PHI_UNKNOWNS; ++l) sum += row[PHI_DIM + l] * z[l][i];
                sum *= s->h * phi_weights[i];
                if (sweep > 0) change = fmax(change, fabs(sum - varied[k][i]));
                size = fmax(size, fabs(sum));
                if (!isfinite(sum)) return 0;
                varied[k][i] = sum;
            }
        for (int k = 0; k < PHI_UNKNOWNS; ++k)
            for (int i = PHI_NODES; i < PHI_WIDTH; ++i) varied[k][i] = 0.0;
        phi_mixed(phi_mixing, varied, z);
        if (sweep == 0) continue;
        if (change <= PHI_TANGENT_SOLVED * size) return 1;
        if (change <= PHI_TANGENT_NEARLY_SOLVED * size && change > PHI_TANGENT_SHRINKING * previous) return 1;
        previous = change;
    }
    return 0;
}

/* The derivative of the step that s has made from at, and its change. */
static phi_status phi_tangent_stage(const phi_solver *s, const phi_solver *at, double change[PHI_DIM],
    double derivative[PHI_DIM * PHI_DIM])
{
    double point[PHI_POINT], end[PHI_UNKNOWNS], node[PHI_UNKNOWNS], along[PHI_UNKNOWNS];
    double slopes[PHI_NODES][PHI_SLOPES], outer[PHI_DIM * (PHI_DIM + PHI_UNKNOWNS)];
    phi_lanes moves[PHI_UNKNOWNS], z[PHI_UNKNOWNS];
    phi_solver twin = *s;
    memcpy(twin.x, at->x, sizeof twin.x);
    twin.t = at->t;
    twin.history.count = 0;
    phi_start(&twin, point);
    const phi_status status = phi_collocate(&twin, point, moves);
    if (status != PHI_OK) return status;
    phi_mixed(phi_mixing, moves, z);
    for (int i = 0; i < PHI_NODES; ++i) {
        for (int k = 0; k < PHI_UNKNOWNS; ++k) node[k] = z[k][i];
        phi_stage_slope_jacobian(s->coef, point, node, slopes[i]);
    }
    phi_end(moves, end);
    phi_stage_change(s->coef, point, end, change);
    phi_stage_change_jacobian(s->coef, point, end, outer);
    for (int j = 0; j < PHI_DIM; ++j) {
        if (!phi_vary(s, slopes, j, moves)) return PHI_NO_CONVERGENCE;
        phi_end(moves, along);
        for (int i = 0; i < PHI_DIM; ++i) {
            const double *row = outer + i * (PHI_DIM + PHI_UNKNOWNS);
            double sum = row[j] + (i == j ? 1.0 : 0.0);
            for (int k = 0; k < PHI_UNKNOWNS; ++k) sum += row[PHI_DIM + k] * along[k];
            derivative[i * PHI_DIM + j] = sum;
        }
    }
    return PHI_OK;
}

#elif PHI_NEWTON
/* The derivative of one implicit stage: alpha = x gives Dy = jacobian^-1, and the stage is 1 + increment_jacobian Dy.
   All is evaluated at the y of the stage itself, found from its remembered value by corrections that shrink no more. */
static phi_status phi_tangent_stage(const double *coef, const double x[PHI_DIM], const double carry[PHI_DIM],
    const double value[PHI_DIM], double change[PHI_DIM], double derivative[PHI_DIM * PHI_DIM])
{
    double y[PHI_DIM], side[PHI_DIM], displacement[PHI_DIM];
    double jacobian[PHI_DIM * PHI_DIM], matrix[PHI_DIM * PHI_DIM], slope[PHI_DIM * PHI_DIM], previous = HUGE_VAL;
    memcpy(y, value, sizeof y);
    for (int iteration = 0; iteration <= PHI_MAX_ITERATIONS; ++iteration) {
        phi_linearise(coef, y, displacement, change, jacobian, slope);
        for (int i = 0; i < PHI_DIM; ++i) side[i] = ((y[i] - x[i]) + displacement[i]) - carry[i];
        memcpy(matrix, jacobian, sizeof matrix);
        if (!phi_solve(matrix, side)) return PHI_SINGULAR;
        const double size = phi_size(y, side);
        if (!isfinite(size)) return PHI_NOT_FINITE;
        if (phi_tangent_solved(size, previous)) break;
        if (iteration == PHI_MAX_ITERATIONS) return PHI_NO_CONVERGENCE;
        for (int i = 0; i < PHI_DIM; ++i) y[i] -= side[i];
        previous = size;
    }
    memset(matrix, 0, sizeof matrix);
    for (int i = 0; i < PHI_DIM; ++i) matrix[i * PHI_DIM + i] = 1.0;
    if (!phi_tangent_solve(jacobian, matrix)) return PHI_SINGULAR;
    phi_tangent_product(slope, matrix, derivative);
    for (int i = 0; i < PHI_DIM; ++i) derivative[i * PHI_DIM + i] += 1.0;
    return PHI_OK;
}

#elif PHI_PATH
/* Whether the path and its variation satisfy their equation at m, where their expansions have the given slope. */
static int phi_tangent_holds(const double *coef, const double p[2 * PHI_DIM], const double m[2 * PHI_DIM],
    const double slope[2 * PHI_DIM])
{
    double field[2 * PHI_DIM], scale[2] = { 0.0, 0.0 };
    phi_tangent_field(coef, p, m, field);
    for (int i = 0; i < 2 * PHI_DIM; ++i) scale[i / PHI_DIM] += fabs(m[i]) + fabs(slope[i]);
    for (int i = 0; i < 2 * PHI_DIM; ++i)
        if (!(fabs(field[i] - slope[i]) <= PHI_TANGENT_ROUNDED_SLOPE * scale[i / PHI_DIM])) return 0;
    return 1;
}

/* The path dm/dt = pi(m) p with its variation, 0 <= t <= 1, by their Taylor series: change is the end minus the start,
   mean the mean minus the start. 0 if PHI_TERMS terms do not suffice. */
static int phi_tangent_piece(const double *coef, const double p[2 * PHI_DIM], const double start[2 * PHI_DIM],
    double change[2 * PHI_DIM], double mean[2 * PHI_DIM])
{
    double series[PHI_TANGENT_SERIES][PHI_TERMS + 1], fixed[PHI_TANGENT_FIXED], end[2 * PHI_DIM], slope[2 * PHI_DIM], norm[2] = { DBL_MIN, DBL_MIN };
    int small = 0;
    for (int i = 0; i < 2 * PHI_DIM; ++i) {
        series[i][0] = start[i];
        change[i] = mean[i] = slope[i] = 0.0;
        norm[i / PHI_DIM] += fabs(start[i]);
    }
    phi_tangent_begin(coef, p, series, fixed);
    for (int k = 0; k < PHI_TERMS; ++k) {
        phi_tangent_order(coef, p, series, fixed, k);
        int negligible = 1;
        for (int i = 0; i < 2 * PHI_DIM; ++i) {
            const double term = series[i][k + 1];
            change[i] += term;
            mean[i] += term / (double)(k + 2);
            slope[i] += (double)(k + 1) * term;
            end[i] = start[i] + change[i];
            if (!(fabs(term) <= PHI_TANGENT_NEGLIGIBLE * (norm[i / PHI_DIM] + fabs(change[i])))) negligible = 0;
        }
        small = negligible ? small + 1 : 0;
        if (small >= 2 && phi_tangent_holds(coef, p, end, slope)) return 1;
    }
    return 0;
}

/* End and mean of the whole path from x under p, minus x, with their variations under a variation of x (the first
   PHI_DIM seeds) or of p (the others): change and mean hold the state, then its variation. 0 if it cannot be followed. */
static int phi_tangent_seed(const double *coef, const double x[PHI_DIM], const double p[PHI_DIM], int seed,
    double change[2 * PHI_DIM], double mean[2 * PHI_DIM])
{
    for (int pieces = 1; pieces <= PHI_LONGEST_PATH; pieces *= 2) {
        double q[2 * PHI_DIM], start[2 * PHI_DIM], point[2 * PHI_DIM], shift[2 * PHI_DIM], local[2 * PHI_DIM];
        int good = 1;
        for (int i = 0; i < PHI_DIM; ++i) {
            q[i] = p[i] / (double)pieces;
            q[PHI_DIM + i] = seed == PHI_DIM + i ? 1.0 / (double)pieces : 0.0;
            start[i] = x[i];
            start[PHI_DIM + i] = seed == i ? 1.0 : 0.0;
        }
        for (int i = 0; i < 2 * PHI_DIM; ++i) change[i] = mean[i] = 0.0;
        for (int piece = 0; piece < pieces && good; ++piece) {
            for (int i = 0; i < 2 * PHI_DIM; ++i) point[i] = start[i] + change[i];
            good = phi_tangent_piece(coef, q, point, shift, local);
            for (int i = 0; i < 2 * PHI_DIM; ++i) {
                mean[i] += (change[i] + local[i]) / (double)pieces;
                change[i] += shift[i];
            }
        }
        if (good) return 1;
    }
    return 0;
}

/* The derivative of one stage: p = grad S_h(mean) gives (1 - H mean_p) Dp = H mean_x with H the Hessian of S_h, and the
   stage is end_x + end_p Dp, with p found from the remembered mean, value, by corrections that shrink no more. */
static phi_status phi_tangent_stage(const double *coef, const double x[PHI_DIM], const double carry[PHI_DIM],
    const double value[PHI_DIM], double change[PHI_DIM], double derivative[PHI_DIM * PHI_DIM])
{
    double p[PHI_DIM], y[PHI_DIM], side[PHI_DIM], end[2 * PHI_DIM], mean[2 * PHI_DIM], previous = HUGE_VAL;
    double ends[2][PHI_DIM * PHI_DIM], means[2][PHI_DIM * PHI_DIM], slope[PHI_DIM * PHI_DIM], jacobian[PHI_DIM * PHI_DIM], matrix[PHI_DIM * PHI_DIM];
    (void)carry;
    phi_curvature(coef, value, p, slope);
    for (int iteration = 0; iteration <= PHI_MAX_ITERATIONS; ++iteration) {
        double size = 0.0, norm = DBL_MIN;
        for (int k = 0; k < 2 * PHI_DIM; ++k) {
            if (!phi_tangent_seed(coef, x, p, k, end, mean)) return PHI_NO_CONVERGENCE;
            for (int i = 0; i < PHI_DIM; ++i) {
                ends[k / PHI_DIM][i * PHI_DIM + k % PHI_DIM] = end[PHI_DIM + i] + (i == k ? 1.0 : 0.0);
                means[k / PHI_DIM][i * PHI_DIM + k % PHI_DIM] = mean[PHI_DIM + i] + (i == k ? 1.0 : 0.0);
            }
        }
        for (int i = 0; i < PHI_DIM; ++i) y[i] = x[i] + mean[i];
        phi_curvature(coef, y, side, slope);
        phi_tangent_product(slope, means[1], jacobian);
        for (int i = 0; i < PHI_DIM * PHI_DIM; ++i) jacobian[i] = (i % (PHI_DIM + 1) == 0 ? 1.0 : 0.0) - jacobian[i];
        for (int i = 0; i < PHI_DIM; ++i) side[i] = p[i] - side[i];
        memcpy(matrix, jacobian, sizeof matrix);
        if (!phi_solve(matrix, side)) return PHI_SINGULAR;
        for (int i = 0; i < PHI_DIM; ++i) {
            size = fabs(side[i]) > size ? fabs(side[i]) : size;
            norm = fabs(p[i]) > norm ? fabs(p[i]) : norm;
        }
        size /= norm;
        if (!isfinite(size)) return PHI_NOT_FINITE;
        if (phi_tangent_solved(size, previous)) break;
        if (iteration == PHI_MAX_ITERATIONS) return PHI_NO_CONVERGENCE;
        for (int i = 0; i < PHI_DIM; ++i) p[i] -= side[i];
        previous = size;
    }
    memcpy(change, end, PHI_DIM * sizeof change[0]);
    phi_tangent_product(slope, means[0], matrix);
    memcpy(slope, matrix, sizeof slope);
    if (!phi_tangent_solve(jacobian, slope)) return PHI_SINGULAR;
    phi_tangent_product(ends[1], slope, derivative);
    for (int i = 0; i < PHI_DIM * PHI_DIM; ++i) derivative[i] += ends[0][i];
    return PHI_OK;
}

#else
/* The derivative of one step, the product of those of its flows, and its step from x + carry. The value is unused. */
static phi_status phi_tangent_stage(const double *coef, const double x[PHI_DIM], const double carry[PHI_DIM],
    const double value[PHI_DIM], double change[PHI_DIM], double derivative[PHI_DIM * PHI_DIM])
{
#if PHI_MONITOR
    double y[PHI_ALONG] = { 0.0 }, moved[PHI_ALONG] = { 0.0 }, start[PHI_ALONG] = { 0.0 };
    double slope[PHI_DIM * PHI_DIM], product[PHI_DIM * PHI_DIM];
    (void)value;
    memcpy(start, x, PHI_DIM * sizeof x[0]);
    memcpy(y, x, PHI_DIM * sizeof x[0]);
    memcpy(moved, carry, PHI_DIM * sizeof carry[0]);
#else
    double y[PHI_DIM], moved[PHI_DIM], slope[PHI_DIM * PHI_DIM], product[PHI_DIM * PHI_DIM];
    (void)value;
    memcpy(y, x, sizeof y);
    memcpy(moved, carry, sizeof moved);
#endif
    memset(derivative, 0, sizeof product);
    for (int i = 0; i < PHI_DIM; ++i) derivative[i * PHI_DIM + i] = 1.0;
    for (int k = 0; k < PHI_FLOWS; ++k) {
#if PHI_MONITOR
        phi_tangent_flow(phi_part_of[k], coef + phi_row_of[k] * PHI_ROW, y, moved, start, slope);
#else
        phi_tangent_flow(phi_part_of[k], coef + phi_row_of[k] * PHI_ROW, y, moved, x, slope);
#endif
        phi_tangent_product(slope, derivative, product);
        for (int i = 0; i < PHI_DIM * PHI_DIM; ++i) derivative[i] += product[i];
    }
    for (int i = 0; i < PHI_DIM; ++i) change[i] = moved[i] - carry[i];
    return PHI_OK;
}

#endif
/* Move at through one stage of the step that s has made, and multiply product by the derivative. */
static phi_status phi_tangent_of(const phi_solver *s PHI_AND_INT_STAGE, phi_solver *at, double product[PHI_DIM * PHI_DIM])
{
    double derivative[PHI_DIM * PHI_DIM], both[PHI_DIM * PHI_DIM], change[PHI_DIM];
#if PHI_GAUSS
    const phi_status status = phi_tangent_stage(s, at, change, derivative);
#else
#if PHI_RECURRENCES
    const phi_history *history = &PHI_OF(s->history, stage);
    const double *value = history->past[history->count - 1];
#elif PHI_GUESSED
    const double *value = PHI_OF(s->history, stage).difference[0];
#else
    const double *value = at->x;
#endif
    const phi_status status = phi_tangent_stage(PHI_OF(s->coef, stage), at->x, at->carry, value, change, derivative);
#endif
    if (status != PHI_OK) return status;
    if (!phi_advance(at, change, at->carry)) return PHI_NOT_FINITE;
    phi_tangent_product(derivative, product, both);
    memcpy(product, both, sizeof both);
    return PHI_OK;
}

phi_status phi_step_tangent(phi_solver *s, double h, double tangent[PHI_DIM * PHI_DIM])
{
    double product[PHI_DIM * PHI_DIM];
    if (s == NULL || tangent == NULL) return PHI_BAD_ARGUMENT;
    const phi_solver before = *s;
    phi_solver at = before;
    phi_status status = phi_step(s, h);
    memset(product, 0, sizeof product);
    for (int i = 0; i < PHI_DIM; ++i) product[i * PHI_DIM + i] = 1.0;
    PHI_EACH_STAGE
        if (status == PHI_OK) status = phi_tangent_of(s PHI_AND_STAGE, &at, product);
    for (int i = 0; i < PHI_DIM * PHI_DIM && status == PHI_OK; ++i)
        if (!isfinite(product[i])) status = PHI_NOT_FINITE;
    if (status == PHI_OK)
        memcpy(tangent, product, sizeof product);
    else
        *s = before;
    return status;
}
#endif
