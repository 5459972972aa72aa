#ifndef PHI_FILE_PATH
#define PHI_FILE_PATH
#include <float.h>
#include <math.h>
#include <string.h>

#include "algebra.c"
#include "implicit.c"
#include "attitude.c"
#include "model.h"
#include "taylor.c"
#include "path_model.h"

/* ---- The implicit step, along paths dm/dt = pi(m) p ---- */
#include "path_policy.h"

/* Whether the slope of the Taylor series of a path at a point m is pi(m) p. If not, the series only seems to have converged:
   it has gaps between its terms, such as t + t^9, or extends across the kink of an absolute value. */
static int phi_holds(const double *coef, const double p[PHI_DIM], const double m[PHI_DIM],
    const double slope[PHI_DIM])
{
    double field[PHI_DIM], scale = 0.0;
    phi_path_field(coef, p, m, field);
    for (int i = 0; i < PHI_DIM; ++i) scale += fabs(m[i]) + fabs(slope[i]);
    for (int i = 0; i < PHI_DIM; ++i)
        if (!(fabs(field[i] - slope[i]) <= PHI_ROUNDED_SLOPE * scale)) return 0;
    return 1;
}

/* Compute the path dm/dt = pi(m) p, 0 <= t <= 1, from m(0) = `start`, by its Taylor series. `change` receives m(1) -
   m(0), and `mean` the mean of m(t) - m(0). Terms are added until they are negligible. Returns 0 if PHI_TERMS terms do
   not suffice. */
static int phi_piece(const double *coef, const double p[PHI_DIM], const double start[PHI_DIM], double change[PHI_DIM],
    double mean[PHI_DIM])
{
    double series[PHI_SERIES][PHI_TERMS + 1], fixed[PHI_FIXED], end[PHI_DIM], slope[PHI_DIM], norm = 0.0;
    int small_terms = 0;
    for (int i = 0; i < PHI_DIM; ++i) {
        series[i][0] = start[i];
        change[i] = mean[i] = slope[i] = 0.0;
        norm += fabs(start[i]);
    }
    phi_path_begin(coef, p, series, fixed);
    for (int k = 0; k < PHI_TERMS; ++k) {
        phi_path_order(coef, p, series, fixed, k);
        int negligible = 1;
        for (int i = 0; i < PHI_DIM; ++i) {
            const double term = series[i][k + 1];
            change[i] += term;
            mean[i] += term / (double)(k + 2);
            slope[i] += (double)(k + 1) * term;
            end[i] = start[i] + change[i];
            const double measure = fabs(start[i]) + fabs(change[i]) + PHI_LEAST_SHARE * norm;
            if (!(fabs(term) <= PHI_NEGLIGIBLE * measure)) negligible = 0;
        }
        small_terms = negligible ? small_terms + 1 : 0;
        if (small_terms >= 2 && phi_holds(coef, p, end, slope)) return 1;
    }
    return 0;
}

/* Compute the whole path from x, in 1, 2, 4, ... pieces until the series of each piece converges. `change` receives the
   end of the path minus x, and `mean` the mean of the path minus x. For any p, the end of the path lies on the
   symplectic leaf of x. Returns 0 if the path is too long or leaves the domain of pi. *pieces_used increases by the
   number of computed pieces. */
static int phi_path(const double *coef, const double x[PHI_DIM], const double p[PHI_DIM], double change[PHI_DIM],
    double mean[PHI_DIM], int *pieces_used)
{
    for (int pieces = 1; pieces <= PHI_LONGEST_PATH; pieces *= 2) {
        double q[PHI_DIM], point[PHI_DIM], shift[PHI_DIM], piece_mean[PHI_DIM];
        int good = 1;
        for (int i = 0; i < PHI_DIM; ++i) {
            q[i] = p[i] / (double)pieces;
            change[i] = mean[i] = 0.0;
        }
        for (int piece = 0; piece < pieces && good; ++piece) {
            for (int i = 0; i < PHI_DIM; ++i) point[i] = x[i] + change[i];
            good = phi_piece(coef, q, point, shift, piece_mean);
            ++*pieces_used;
            for (int i = 0; i < PHI_DIM; ++i) {
                mean[i] += (change[i] + piece_mean[i]) / (double)pieces;
                change[i] += shift[i];
            }
        }
        if (good) return 1;
    }
    return 0;
}

/* For the path from s->x with the covector p, compute its mean y, the residual p - grad S_h(y), the change of x along the
   path, and an approximate Jacobian of the residual. Returns 0 if phi_path fails. */
static int phi_residual(phi_solver *s, const double *coef, const double p[PHI_DIM], double y[PHI_DIM],
    double residual[PHI_DIM], double change[PHI_DIM], double jacobian[PHI_DIM * PHI_DIM], int *pieces_used)
{
    double mean[PHI_DIM];
    if (!phi_path(coef, s->x, p, change, mean, pieces_used)) return 0;
    for (int i = 0; i < PHI_DIM; ++i) y[i] = s->x[i] + mean[i];
    phi_generate(coef, y, residual, jacobian);
    for (int i = 0; i < PHI_DIM; ++i) residual[i] = p[i] - residual[i];
    ++s->evaluations;
    return 1;
}

/* Compute the Jacobian of the residual by differences. It serves for steps so large that iterations with the approximate
   Jacobian do not converge. */
static int phi_differences(phi_solver *s, const double *coef, const double p[PHI_DIM], const double residual[PHI_DIM],
    double jacobian[PHI_DIM * PHI_DIM], int *pieces_used)
{
    double q[PHI_DIM], y[PHI_DIM], shifted_residual[PHI_DIM], change[PHI_DIM], unused[PHI_DIM * PHI_DIM], norm = DBL_MIN;
    for (int i = 0; i < PHI_DIM; ++i) norm = fabs(p[i]) > norm ? fabs(p[i]) : norm;
    for (int j = 0; j < PHI_DIM; ++j) {
        PHI_COPY(q, p, q, PHI_DIM);
        q[j] += PHI_DIFFERENCE * norm;
        if (!phi_residual(s, coef, q, y, shifted_residual, change, unused, pieces_used)) return 0;
        for (int i = 0; i < PHI_DIM; ++i) jacobian[i * PHI_DIM + j] = (shifted_residual[i] - residual[i]) / (q[j] - p[j]);
    }
    return 1;
}

/* Make one stage: solve p = grad S_h(mean of the path from x with covector p), and move x to the end of that path; S_h is
   the generating function. If the paths of a step need more than PHI_MOST_PIECES Taylor expansions, the step is too large
   for a meaningful solution. */
static phi_status phi_attempt(phi_solver *s PHI_AND_INT_STAGE)
{
    const double *coef = PHI_OF(s->coef, stage);
    double p[PHI_DIM], y[PHI_DIM], residual[PHI_DIM], change[PHI_DIM], jacobian[PHI_DIM * PHI_DIM], previous = HUGE_VAL;
#if PHI_PREDICTED
    if (!phi_predict(&PHI_OF(s->history, stage), y)) PHI_COPY(y, s->x, y, PHI_DIM);
#else
    PHI_COPY(y, s->x, y, PHI_DIM);
#endif
    phi_generate(coef, y, p, jacobian);
    for (int iteration = 0, pieces_used = 0; iteration < PHI_MAX_ITERATIONS && pieces_used <= PHI_MOST_PIECES; ++iteration) {
        if (!phi_residual(s, coef, p, y, residual, change, jacobian, &pieces_used)) return PHI_NO_CONVERGENCE;
        double size = 0.0, norm = DBL_MIN;
        for (int i = 0; i < PHI_DIM; ++i) {
            if (!isfinite(residual[i])) return PHI_NOT_FINITE;
            size = fabs(residual[i]) > size ? fabs(residual[i]) : size;
            norm = fabs(p[i]) > norm ? fabs(p[i]) : norm;
        }
        size /= norm;
        const int stalled = previous < PHI_NEARLY_SOLVED && size > PHI_SHRINKING * previous;
        if (size <= PHI_SOLVED || stalled) {
            if (!phi_plausible(s PHI_AND_STAGE, change)) return PHI_NO_CONVERGENCE;
#if PHI_MONITOR
            double elapsed[1];
            phi_elapsed(coef, y, elapsed);
            if (!(elapsed[0] * (PHI_FRACTION(s->h)) > 0.0)) return PHI_NOT_FINITE;
#endif
            if (!phi_advance(s, change, s->carry)) return PHI_NOT_FINITE;
            PHI_PASS(s, elapsed[0])
            phi_remember(&PHI_OF(s->history, stage), y PHI_AND_ITERATION);
#if PHI_ATTITUDE
            double factor[PHI_ELEMENT];
            phi_factor(s PHI_AND_STAGE, y, factor);
            phi_turn_by(s, factor PHI_AND_ASIDE(s->aside));
#endif
            return PHI_OK;
        }
        const int slow = iteration >= PHI_PATIENCE && size > PHI_CONTRACTING * previous;
        if (slow && !phi_differences(s, coef, p, residual, jacobian, &pieces_used)) return PHI_NO_CONVERGENCE;
        if (!phi_solve(jacobian, residual)) return PHI_SINGULAR;
        for (int i = 0; i < PHI_DIM; ++i) p[i] -= residual[i];
        previous = size;
    }
    return PHI_NO_CONVERGENCE;
}
#endif
