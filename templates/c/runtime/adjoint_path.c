#ifndef PHI_FILE_ADJOINT_PATH
#define PHI_FILE_ADJOINT_PATH
#include <float.h>
#include <math.h>
#include <string.h>
#include "adjoint_stage.c"
#include "adjoint_path.h"

#define PHI_BACK_NEGLIGIBLE 1e-18    /* terms of a series that are smaller than this, relative to start and sum, are negligible */
#define PHI_BACK_ROUNDED_SLOPE 1e-13 /* accepted error of the slope of a series, relative to the path and its slope */
#define PHI_ANCHORED 8               /* largest number of corrections of the end of a path, to make its mean equal to y */
#define PHI_ANCHORED_TO 1e-15        /* accuracy that these corrections give to the mean, relative to y */

/* A path that is integrated backward has four groups of quantities: the state, its cotangent, the cotangent of p, and
   the cotangents of the coefficients. Compute the sum of the magnitudes in each group. */
static void phi_back_sizes(const double values[PHI_BACK], double sizes[4])
{
    for (int g = 0; g < 4; ++g) sizes[g] = 0.0;
    for (int i = 0; i < PHI_BACK; ++i) sizes[i < 3 * PHI_DIM ? i / PHI_DIM : 3] += fabs(values[i]);
}

/* Whether the slope of the Taylor series at m satisfies the differential equation of a path integrated backward. The
   slopes of the cotangents of p and of the coefficients are sums over products of pi with the cotangent of the state.
   Their terms may cancel, so errors are also compared with the sizes of these terms. */
static int phi_back_holds(const double *coef, const double p[PHI_BACK], const double m[PHI_BACK],
    const double slope[PHI_BACK])
{
    double field[PHI_BACK], of_m[4], of_slope[4], of_p = 0.0;
    phi_back_field(coef, p, m, field);
    phi_back_sizes(m, of_m);
    phi_back_sizes(slope, of_slope);
    for (int i = 0; i < PHI_DIM; ++i) of_p += fabs(p[i]);
    for (int i = 0; i < PHI_BACK; ++i) {
        const int g = i < 3 * PHI_DIM ? i / PHI_DIM : 3;
        const double factor = g == 2 ? of_p : g == 3 ? fabs(coef[phi_back_used[i - 3 * PHI_DIM]]) : 0.0;
        const double terms = factor > 0.0 ? of_slope[0] * of_m[1] / factor : 0.0;
        if (!(fabs(field[i] - slope[i]) <= PHI_BACK_ROUNDED_SLOPE * (of_m[g] + of_slope[g] + terms) + DBL_MIN)) return 0;
    }
    return 1;
}

/* Integrate a path backward with its cotangents, 0 <= t <= 1, by Taylor series. `change` receives the end minus the
   start. Returns 0 if PHI_TERMS terms do not suffice. */
static int phi_back_piece(const double *coef, const double p[PHI_BACK], const double start[PHI_BACK],
    double change[PHI_BACK])
{
    double series[PHI_BACK_SERIES][PHI_TERMS + 1], fixed[PHI_BACK_FIXED], end[PHI_BACK], slope[PHI_BACK];
    double of_start[4], of_change[4];
    int small_terms = 0;
    for (int i = 0; i < PHI_BACK; ++i) {
        series[i][0] = start[i];
        change[i] = slope[i] = 0.0;
    }
    phi_back_sizes(start, of_start);
    phi_back_begin(coef, p, series, fixed);
    for (int k = 0; k < PHI_TERMS; ++k) {
        phi_back_order(coef, p, series, fixed, k);
        for (int i = 0; i < PHI_BACK; ++i) {
            const double term = series[i][k + 1];
            change[i] += term;
            slope[i] += (double)(k + 1) * term;
            end[i] = start[i] + change[i];
        }
        int negligible = 1;
        phi_back_sizes(change, of_change);
        for (int i = 0; i < PHI_BACK; ++i) {
            const int g = i < 3 * PHI_DIM ? i / PHI_DIM : 3;
            const double size = of_start[g] + of_change[g];
            if (!(fabs(series[i][k + 1]) <= PHI_BACK_NEGLIGIBLE * size + DBL_MIN)) negligible = 0;
        }
        small_terms = negligible ? small_terms + 1 : 0;
        if (small_terms >= 2 && phi_back_holds(coef, p, end, slope)) return 1;
    }
    return 0;
}

/* Integrate a path backward from its end, to compute cotangents of its start, of p and of the coefficients. `bar` and
   `mean_bar` are the cotangents of its end and of its mean. `cotangents` receives the start of the path, then the
   cotangents. Returns 0 if the path cannot be followed. */
static int phi_traced_back(const double *coef, const double end[PHI_DIM], const double p[PHI_DIM],
    const double bar[PHI_DIM], const double mean_bar[PHI_DIM], double cotangents[PHI_BACK])
{
    for (int pieces = 1; pieces <= PHI_LONGEST_PATH; pieces *= 2) {
        double fixed_inputs[PHI_BACK] = { 0.0 }, change[PHI_BACK];
        int good = 1;
        for (int i = 0; i < PHI_BACK; ++i) cotangents[i] = 0.0;
        for (int i = 0; i < PHI_DIM; ++i) {
            fixed_inputs[i] = p[i] / (double)pieces;
            fixed_inputs[PHI_DIM + i] = mean_bar[i] / (double)pieces;
            cotangents[i] = end[i];
            cotangents[PHI_DIM + i] = bar[i];
        }
        for (int piece = 0; piece < pieces && good; ++piece) {
            good = phi_back_piece(coef, fixed_inputs, cotangents, change);
            for (int i = 0; i < PHI_BACK; ++i) cotangents[i] += i / PHI_DIM == 2 ? change[i] / (double)pieces : change[i];
        }
        if (good) return 1;
    }
    return 0;
}

/* Correct an approximate end of a path so that the mean becomes y, as long as corrections shrink the error: on long
   paths the mean may change by more than the end does. Returns 0 if the path cannot be followed. */
static int phi_anchor(const double *coef, const double p[PHI_DIM], const double y[PHI_DIM], double end[PHI_DIM])
{
    double minus[PHI_DIM], change[PHI_DIM], mean[PHI_DIM], miss[PHI_DIM], shifted_end[PHI_DIM], before = HUGE_VAL;
    int pieces_used = 0;
    for (int i = 0; i < PHI_DIM; ++i) minus[i] = -p[i];
    memcpy(shifted_end, end, sizeof shifted_end);
    for (int round = 0; round < PHI_ANCHORED; ++round) {
        double size = 0.0, missed = 0.0;
        if (!phi_path(coef, shifted_end, minus, change, mean, &pieces_used)) return round > 0;
        for (int i = 0; i < PHI_DIM; ++i) {
            miss[i] = y[i] - (shifted_end[i] + mean[i]);
            size += fabs(y[i]);
            missed += fabs(miss[i]);
        }
        if (!(missed < before)) return 1;
        before = missed;
        for (int i = 0; i < PHI_DIM; ++i) {
            end[i] = shifted_end[i];
            shifted_end[i] += miss[i];
        }
        if (missed <= PHI_ANCHORED_TO * size) return 1;
    }
    return 1;
}

/* Pull a cotangent back through a stage whose path had the mean y. Its covector is p = grad S_h(y), with the generating
   function S_h and its Hessian H. The cotangent w of p solves w = b + B H w, where b comes from the end of the path,
   and B from its mean. */
static phi_status phi_stage_adjoint(const double *coef, const double y[PHI_DIM], phi_cotangent *bar,
    double coef_bar[PHI_COEFFICIENTS])
{
    double p[PHI_DIM], hessian[PHI_DIM * PHI_DIM], matrix[PHI_DIM * PHI_DIM], covector[PHI_DIM], mean_bar[PHI_DIM], cotangents[PHI_BACK];
    double columns[PHI_DIM][PHI_DIM], slopes[PHI_COEFFICIENTS];
    const double zero[PHI_DIM] = { 0.0 };
    const double *end = bar->end;
    phi_curvature(coef, y, p, hessian);
    if (!phi_anchor(coef, p, y, bar->end)) return PHI_NO_CONVERGENCE;
    for (int j = 0; j < PHI_DIM; ++j) {
        double unit[PHI_DIM] = { 0.0 };
        unit[j] = 1.0;
        if (!phi_traced_back(coef, end, p, zero, unit, cotangents)) return PHI_NO_CONVERGENCE;
        memcpy(columns[j], cotangents + 2 * PHI_DIM, sizeof columns[j]);
    }
    for (int i = 0; i < PHI_DIM; ++i)
        for (int j = 0; j < PHI_DIM; ++j) {
            double sum = i == j ? 1.0 : 0.0;
            for (int k = 0; k < PHI_DIM; ++k) sum -= columns[k][i] * hessian[j * PHI_DIM + k];
            matrix[i * PHI_DIM + j] = sum;
        }
    if (!phi_traced_back(coef, end, p, bar->x, zero, cotangents)) return PHI_NO_CONVERGENCE;
    memcpy(covector, cotangents + 2 * PHI_DIM, sizeof covector);
    if (!phi_solve(matrix, covector)) return PHI_SINGULAR;
    for (int i = 0; i < PHI_DIM; ++i) {
        mean_bar[i] = 0.0;
        for (int k = 0; k < PHI_DIM; ++k) mean_bar[i] += hessian[k * PHI_DIM + i] * covector[k];
    }
    if (!phi_traced_back(coef, end, p, bar->x, mean_bar, cotangents)) return PHI_NO_CONVERGENCE;
    memcpy(bar->x, cotangents + PHI_DIM, sizeof bar->x);
    memcpy(bar->end, cotangents, sizeof bar->end);
    phi_slope_adjoint(coef, y, covector, slopes);
    for (int k = 0; k < PHI_COEFFICIENTS; ++k) coef_bar[k] += slopes[k];
    for (int k = 3 * PHI_DIM; k < PHI_BACK; ++k) coef_bar[phi_back_used[k - 3 * PHI_DIM]] += cotangents[k];
    return PHI_OK;
}
#endif
