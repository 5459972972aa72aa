#ifndef PHI_FILE_TANGENT_PATH
#define PHI_FILE_TANGENT_PATH
#include <math.h>
#include <string.h>

#include "algebra.c"
#include "model.h"
#include "solver.c"
#include "tangent_implicit.c"
#include "tangent_model.h"
#include "path_tangent_policy.h"
#include "tangent_product.c"

/* Whether the slopes of the Taylor series of a path and of its variation satisfy their differential equations at a
   point m. */
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

/* Compute the path dm/dt = pi(m) p, 0 <= t <= 1, with its variation, by Taylor series. `change` receives the end minus
   the start, and `mean` the mean minus the start. Returns 0 if PHI_TERMS terms do not suffice. */
static int phi_tangent_piece(const double *coef, const double p[2 * PHI_DIM], const double start[2 * PHI_DIM],
    double change[2 * PHI_DIM], double mean[2 * PHI_DIM])
{
    double series[PHI_TANGENT_SERIES][PHI_TERMS + 1], fixed[PHI_TANGENT_FIXED], end[2 * PHI_DIM], slope[2 * PHI_DIM], norm[2] = { DBL_MIN, DBL_MIN };
    int small_terms = 0;
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
        small_terms = negligible ? small_terms + 1 : 0;
        if (small_terms >= 2 && phi_tangent_holds(coef, p, end, slope)) return 1;
    }
    return 0;
}

/* Compute the end (change) and the mean of the whole path from x with covector p, both minus x. Each is followed by its
   variation under a variation of x[seed], or of p[seed - PHI_DIM] if seed >= PHI_DIM. Returns 0 if the path cannot be
   followed. */
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

/* Compute the derivative of one stage, which follows a path from x with a covector p that solves p = grad S_h(mean). The
   derivative is end_x + end_p Dp. The derivative Dp of p by x solves (1 - H mean_p) Dp = H mean_x, where H is the Hessian
   of S_h; end_x, end_p, mean_x and mean_p are derivatives of end and mean of the path by x and p. p is first refined to
   rounding level, starting from `value`, the stored mean. */
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
#endif
