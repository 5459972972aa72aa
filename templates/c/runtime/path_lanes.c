#ifndef PHI_FILE_PATH_LANES
#define PHI_FILE_PATH_LANES
#include <float.h>
#include <math.h>
#include <string.h>

#include "lanes.c"
#include "model.h"
#include "model_lanes.h"
#include "newton_lanes.c"
#include "path.c"

/* ---- Paths in lanes ---- */
enum {
    PHI_TERMS_OF_LANES = 16, /* most of the expansion of a path from its middle */
    PHI_ROUNDS = 12          /* of the iteration for the middle, which gains some digits in each */
};

#define PHI_SLOPE_ACCURACY 1e-7  /* of the derivatives of paths */
#define PHI_SETTLED 1e-9         /* accuracy of middles: what is left, the passes mend */
#define PHI_GAIN_OF_ROUND 1e-4   /* what a round leaves of the error at best: so long an expansion it gets */
#define PHI_GUESS_ACCURACY 1e-6  /* of expansions for guesses, which are no better */

/* The paths of all lanes as Taylor series about their middle, with half of p: they take the time from -1 to 1, and need
   fewer terms than from their start. s[i][k] is coefficient k of series i, the coordinates first; slope goes on with the
   entries of d(pi p)/dm and of pi, from which v follows, the derivatives along middle and p, row by row. */
typedef struct {
    phi_lanes p[PHI_DIM], fixed[PHI_FIXED], slope_fixed[PHI_SLOPE_FIXED], value[PHI_SERIES];
    phi_lanes s[PHI_SERIES][PHI_TERMS_OF_LANES + 1], slope[PHI_SLOPE_SERIES][PHI_SLOPE_TERMS + 1];
    phi_lanes v[PHI_SLOPE_TERMS + 1][2 * PHI_DIM * PHI_DIM];
    phi_lanes even[PHI_DIM], odd[PHI_DIM], mean[PHI_DIM]; /* sums of terms, those of even order also as means over time */
    phi_lanes v_even[2 * PHI_DIM * PHI_DIM], v_odd[2 * PHI_DIM * PHI_DIM], v_mean[2 * PHI_DIM * PHI_DIM];
    phi_lanes unit[PHI_DIM]; /* what terms are multiplied by to be measured */
    int terms; /* orders that are known */
} phi_expansion;

/* The largest of the lanes; what is not finite does not count: that lane has failed. */
static double phi_largest_finite(const phi_lanes size)
{
    phi_lanes finite;
    PHI_EACH_LANE
    for (int lane = 0; lane < PHI_LANES; ++lane) finite[lane] = size[lane] <= DBL_MAX ? size[lane] : 0.0;
    return phi_largest(finite);
}

#include "path_model_lanes.h"

/* Order k of the series, and with it order k + 1 of the coordinates. */
static void phi_next_order(phi_lanes coef[restrict], phi_expansion *e, int k)
{
    if (k > 0) phi_follow(coef, e, k);
    for (int i = 0; i < PHI_DIM; ++i) {
        const double share = 1.0 / (k + 1);
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) e->s[i][k + 1][lane] = share * e->s[phi_path_slopes[i]][k][lane];
    }
}

/* Begin to expand the paths with the middles m. */
static void phi_begin(phi_lanes coef[restrict], phi_expansion *e, phi_lanes m[restrict PHI_DIM])
{
    phi_lanes norm = { 0.0 };
    phi_values_lanes(coef, e->p, m, e->value, e->fixed);
    for (int i = 0; i < PHI_SERIES; ++i) memcpy(e->s[i][0], e->value[i], sizeof e->value[i]);
    memset(e->even, 0, sizeof e->even);
    memset(e->odd, 0, sizeof e->odd);
    memset(e->mean, 0, sizeof e->mean);
    phi_next_order(coef, e, 0);
    e->terms = 0;
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            e->unit[i][lane] = fabs(m[i][lane]) + fabs(e->s[i][1][lane]) + DBL_MIN;
            norm[lane] += e->unit[i][lane];
        }
    }
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) e->unit[i][lane] = 1.0 / (e->unit[i][lane] + PHI_LEAST_SHARE * norm[lane]);
    }
}

/* Add the terms of the odd order k and of the next; their size. */
static double phi_add_terms(phi_expansion *e, int k)
{
    phi_lanes size = { 0.0 };
    const double share = 1.0 / (k + 2);
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            const double odd = e->s[i][k][lane], even = e->s[i][k + 1][lane];
            e->odd[i][lane] += odd;
            e->even[i][lane] += even;
            e->mean[i][lane] += share * even;
            size[lane] += (fabs(odd) + fabs(even)) * e->unit[i][lane];
        }
    }
    return phi_largest_finite(size);
}

/* Go on by two orders at a time, until these are below accuracy in all lanes that are finite, or PHI_TERMS_OF_LANES are known: whether
   they suffice is checked at the ends. */
static void phi_extend(phi_lanes coef[restrict], phi_expansion *e, double accuracy)
{
    double size = HUGE_VAL;
    for (; e->terms < PHI_TERMS_OF_LANES && size > accuracy; e->terms += 2) {
        if (e->terms > 0) phi_next_order(coef, e, e->terms);
        phi_next_order(coef, e, e->terms + 1);
        size = phi_add_terms(e, e->terms + 1);
    }
}

/* phi_holds in all lanes, at one end of the paths, where the expansions have the given slope: infinite where the
   equation does not hold. */
static void phi_check_end(phi_lanes coef[restrict], phi_expansion *e, phi_lanes m[restrict PHI_DIM],
    phi_lanes slope[restrict PHI_DIM], phi_lanes wrong)
{
    phi_lanes value[PHI_SERIES], fixed[PHI_FIXED], scale = { 0.0 };
    phi_values_lanes(coef, e->p, m, value, fixed);
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) scale[lane] += fabs(m[i][lane]) + fabs(slope[i][lane]);
    }
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            const double off = fabs(value[phi_path_slopes[i]][lane] - slope[i][lane]);
            wrong[lane] += off <= PHI_ROUNDED_SLOPE * scale[lane] ? 0.0 : HUGE_VAL;
        }
    }
}

/* The same at both ends. */
static void phi_check_ends(phi_lanes coef[restrict], phi_expansion *e, phi_lanes wrong)
{
    phi_lanes start[PHI_DIM], end[PHI_DIM], start_slope[PHI_DIM], end_slope[PHI_DIM];
    for (int i = 0; i < PHI_DIM; ++i) {
        phi_lanes even = { 0.0 }, odd = { 0.0 };
        for (int k = 1; k < e->terms; k += 2) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) {
                odd[lane] += k * e->s[i][k][lane];
                even[lane] += (k + 1) * e->s[i][k + 1][lane];
            }
        }
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            start[i][lane] = e->s[i][0][lane] + (e->even[i][lane] - e->odd[i][lane]);
            end[i][lane] = e->s[i][0][lane] + (e->even[i][lane] + e->odd[i][lane]);
            start_slope[i][lane] = odd[lane] - even[lane];
            end_slope[i][lane] = odd[lane] + even[lane];
        }
    }
    phi_check_end(coef, e, start, start_slope, wrong);
    phi_check_end(coef, e, end, end_slope, wrong);
}

/* Begin to expand the paths with mean y, from their middles as far as these are known. */
static void phi_begin_at(phi_lanes coef[restrict], const phi_model *model, phi_expansion *e)
{
    phi_lanes m[PHI_DIM];
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) m[i][lane] = model->y[i][lane] + model->middle[i][lane];
    }
    phi_begin(coef, e, m);
}

/* Find the middles by iteration, which gains some digits each time, with expansions as short as that allows; the last
   can be gone on with. Infinite where that does not converge. */
static void phi_settle(phi_lanes coef[restrict], phi_model *model, phi_expansion *e)
{
    phi_lanes size, norm;
    double left = 1.0;
    memset(model->middle, 0, sizeof model->middle);
    for (int round = 0; left > PHI_SETTLED && round < PHI_ROUNDS; ++round) {
        for (int i = 0; i < PHI_DIM && round > 0; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) model->middle[i][lane] = -e->mean[i][lane];
        }
        phi_begin_at(coef, model, e);
        phi_extend(coef, e, PHI_GAIN_OF_ROUND * left);
        memset(size, 0, sizeof size);
        memset(norm, 0, sizeof norm);
        for (int i = 0; i < PHI_DIM; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) {
                size[lane] += fabs(model->middle[i][lane] + e->mean[i][lane]);
                norm[lane] += fabs(model->y[i][lane]);
            }
        }
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) size[lane] /= norm[lane] + DBL_MIN;
        left = phi_largest_finite(size);
        if (left > 1.0) left = 1.0;
    }
    for (int lane = 0; lane < PHI_LANES && left > PHI_SETTLED; ++lane)
        if (size[lane] > PHI_SETTLED) model->middle[0][lane] = HUGE_VAL;
}

/* Half of p: paths take the time from -1 to 1. */
static void phi_halve(phi_lanes p[restrict PHI_DIM])
{
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) p[i][lane] *= 0.5;
    }
}

/* alpha - y and beta - alpha to leading order, from one short expansion. */
static void phi_evaluate_lanes(phi_lanes coef[restrict], phi_lanes y[restrict PHI_DIM],
    phi_lanes displacement[restrict PHI_DIM], phi_lanes increment[restrict PHI_DIM])
{
    phi_expansion e;
    phi_momentum_lanes(coef, y, e.p);
    phi_halve(e.p);
    phi_begin(coef, &e, y);
    phi_extend(coef, &e, PHI_GUESS_ACCURACY);
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            displacement[i][lane] = (e.even[i][lane] - e.odd[i][lane]) - e.mean[i][lane];
            increment[i][lane] = 2.0 * e.odd[i][lane];
        }
    }
}

/* Order k + 1 of the derivatives; order 0 is 1 along the middle, and 0 along p. */
static void phi_vary_order(phi_expansion *e, int k)
{
    memset(e->v[k + 1], 0, 2 * PHI_DIM * PHI_DIM * sizeof e->v[0][0]);
    phi_vary_source(e, k);
    for (int j = 0; j < k; ++j) phi_vary_by(e, j, k);
}

/* Add the terms of the odd order k of the derivatives and of the next, and measure them: those along the middle beside 1,
   those along p beside their first. */
static void phi_add_slopes(phi_expansion *e, int k, phi_lanes size)
{
    phi_lanes parts[2] = { { 0.0 } }, first = { 0.0 };
    const double share = 1.0 / (k + 2);
    for (int i = 0; i < 2 * PHI_DIM * PHI_DIM; ++i) {
        const int part = i % (2 * PHI_DIM) / PHI_DIM;
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            const double odd = e->v[k][i][lane], even = e->v[k + 1][i][lane];
            e->v_odd[i][lane] += odd;
            e->v_even[i][lane] += even;
            e->v_mean[i][lane] += share * even;
            parts[part][lane] += fabs(odd) + fabs(even);
            first[lane] += fabs(e->v[1][i][lane]);
        }
    }
    PHI_EACH_LANE
    for (int lane = 0; lane < PHI_LANES; ++lane)
        size[lane] = parts[0][lane] + parts[1][lane] / (first[lane] + DBL_MIN);
}

/* The derivatives of the paths along their middles and p, to seven digits: what that leaves of a correction is below
   rounding when it is accepted. Infinite where PHI_SLOPE_TERMS terms do not suffice. */
static void phi_vary(phi_lanes coef[restrict], phi_expansion *e)
{
    phi_lanes slope[PHI_SLOPE_SERIES], size;
    double largest = 1.0, next = 1.0; /* the last two orders, and what is to be expected of the next */
    phi_slope_values_lanes(coef, e->p, e->value, e->fixed, slope, e->slope_fixed);
    for (int i = 0; i < PHI_SLOPE_SERIES; ++i) memcpy(e->slope[i][0], slope[i], sizeof slope[i]);
    memset(e->v_even, 0, sizeof e->v_even);
    memset(e->v_odd, 0, sizeof e->v_odd);
    memset(e->v_mean, 0, sizeof e->v_mean);
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane)
            e->v_even[i * 2 * PHI_DIM + i][lane] = e->v_mean[i * 2 * PHI_DIM + i][lane] = 1.0;
    }
    for (int k = 0; k < PHI_SLOPE_TERMS && next > PHI_SLOPE_ACCURACY; ++k) {
        if (k >= e->terms) phi_next_order(coef, e, k);
        if (k > 0) phi_follow_slopes(coef, e, k);
        phi_vary_order(e, k);
        if (k % 2 == 0) continue;
        phi_add_slopes(e, k, size);
        const double previous = largest;
        largest = phi_largest_finite(size);
        next = largest * (largest / previous);
    }
    for (int lane = 0; lane < PHI_LANES && next > PHI_SLOPE_ACCURACY; ++lane)
        if (size[lane] > PHI_SLOPE_ACCURACY) e->v_mean[0][lane] = HUGE_VAL;
}

/* alpha - y and beta - alpha from an expansion whose mean misses y by little, to first order in that. */
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

/* The matrices of a stage, from the derivatives of the paths and the Hessian of S_h. */
static void phi_linearise_paths(phi_lanes coef[restrict], phi_model *model, phi_expansion *e,
    phi_lanes hessian[restrict PHI_DIM * PHI_DIM])
{
    phi_lanes jacobian[PHI_DIM * PHI_DIM], reciprocal[2 * PHI_DIM];
    phi_vary(coef, e);
    phi_along_mean_lanes(e->v_even, e->v_odd, e->v_mean, hessian, model->alpha_y, model->increment_y, jacobian,
        model->slope, reciprocal);
    phi_invert_lanes(jacobian, model->slope, model->inverse, model->gain, reciprocal + PHI_DIM);
    for (int i = 0; i < 2 * PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane)
            model->inverse[i % PHI_DIM][lane] += fabs(reciprocal[i][lane]) < PHI_LARGEST_RECIPROCAL ? 0.0 : HUGE_VAL;
    }
}

/* The table of a stage, with its matrices or with those of the last pass. */
static void phi_update(phi_lanes coef[restrict], phi_model *model, int matrices)
{
    phi_expansion e;
    phi_lanes hessian[PHI_DIM * PHI_DIM], wrong = { 0.0 };
    if (matrices) phi_curvature_lanes(coef, model->y, e.p, hessian);
    else phi_momentum_lanes(coef, model->y, e.p);
    phi_halve(e.p);
    if (matrices) phi_settle(coef, model, &e);
    else phi_begin_at(coef, model, &e);
    phi_extend(coef, &e, PHI_NEGLIGIBLE);
    phi_check_ends(coef, &e, wrong);
    if (matrices) phi_linearise_paths(coef, model, &e, hessian);
    phi_read_ends(model, &e, wrong);
}
#endif
