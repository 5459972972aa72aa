#ifndef PHI_FILE_EXPANSION_LANES
#define PHI_FILE_EXPANSION_LANES
#include <float.h>
#include <math.h>
#include <string.h>

#include "lanes.c"
#include "largest.c"
#include "model.h"
#include "model_lanes.h"
#include "path.c"

/* ---- Paths in lanes ---- */
enum {
    PHI_TERMS_OF_LANES = 16, /* largest number of terms in the Taylor series of a path about its middle */
    PHI_ROUNDS = 12          /* largest number of iterations for the middle, each of which gains some digits */
};

#define PHI_GAIN_OF_ROUND 1e-4 /* terms are added until they are smaller than this fraction of the error of the middle */

/* The path dm/dt = pi(m) p in each lane, as Taylor series about its middle: with p/2 in place of p, time goes from -1
   to 1, and fewer terms are needed than from the start. s[i][k] is coefficient k of series i; the coordinates are the
   first series. slope has the series of the entries of d(pi p)/dm and of pi. From slope follows v: the derivatives of
   the path by its middle and by p, row by row. */
typedef struct {
    phi_lanes p[PHI_DIM], fixed[PHI_FIXED], slope_fixed[PHI_SLOPE_FIXED], value[PHI_SERIES];
    phi_lanes s[PHI_SERIES][PHI_TERMS_OF_LANES + 1], slope[PHI_SLOPE_SERIES][PHI_SLOPE_TERMS + 1];
    phi_lanes v[PHI_SLOPE_TERMS + 1][2 * PHI_DIM * PHI_DIM];
    phi_lanes even[PHI_DIM], odd[PHI_DIM], mean[PHI_DIM]; /* sums of the terms of even and of odd order; time average of the even terms */
    phi_lanes v_even[2 * PHI_DIM * PHI_DIM], v_odd[2 * PHI_DIM * PHI_DIM], v_mean[2 * PHI_DIM * PHI_DIM];
#if PHI_ALONG
    phi_lanes w[PHI_SLOPE_TERMS + 1][PHI_DIM * PHI_USED]; /* derivatives of the path by coefficients */
    phi_lanes w_even[PHI_DIM * PHI_USED], w_odd[PHI_DIM * PHI_USED], w_mean[PHI_DIM * PHI_USED];
#endif
    phi_lanes unit[PHI_DIM]; /* weights of the terms in the error estimate */
    int terms, varied; /* how many orders of the paths, and of their derivatives, are known */
} phi_expansion;

/* Largest of the values in the lanes. Values that are not finite belong to failed lanes and are left out. */
static double phi_largest_finite(const phi_lanes size)
{
    phi_lanes finite;
    PHI_EACH_LANE
    for (int lane = 0; lane < PHI_LANES; ++lane) finite[lane] = size[lane] <= DBL_MAX ? size[lane] : 0.0;
    return phi_largest(finite);
}

#include "path_model_lanes.h"

/* Compute order k of the series, and order k + 1 of the coordinates. */
static void phi_next_order(phi_lanes coef[restrict], phi_expansion *e, int k)
{
    if (k > 0) phi_follow(coef, e, k);
    for (int i = 0; i < PHI_DIM; ++i) {
        const double share = 1.0 / (double)(k + 1);
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) e->s[i][k + 1][lane] = share * e->s[phi_path_slopes[i]][k][lane];
    }
}

/* Start the expansions of the paths at the middles m. */
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

/* Add the terms of the orders k and k + 1 to the sums; k is odd. Returns the largest size over the lanes. */
static double phi_add_terms(phi_expansion *e, int k)
{
    phi_lanes size = { 0.0 };
    const double share = 1.0 / (double)(k + 2);
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

/* Extend the series of the paths by two orders at a time, until the terms are below accuracy in all finite lanes, or
   PHI_TERMS_OF_LANES orders are known. phi_check_ends checks whether these terms suffice. */
static void phi_extend(phi_lanes coef[restrict], phi_expansion *e, double accuracy)
{
    double size = HUGE_VAL;
    for (; e->terms < PHI_TERMS_OF_LANES && size > accuracy; e->terms += 2) {
        if (e->terms > 0) phi_next_order(coef, e, e->terms);
        phi_next_order(coef, e, e->terms + 1);
        size = phi_add_terms(e, e->terms + 1);
    }
}

/* Check the equation dm/dt = pi(m) p at one end m of the paths, where their series have the given slopes. `wrong`
   becomes infinite in lanes where it does not hold. */
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

/* Check the equation dm/dt = pi(m) p at start and end of the paths. `wrong` becomes infinite in lanes where it does not
   hold. */
static void phi_check_ends(phi_lanes coef[restrict], phi_expansion *e, phi_lanes wrong)
{
    phi_lanes start[PHI_DIM], end[PHI_DIM], start_slope[PHI_DIM], end_slope[PHI_DIM];
    for (int i = 0; i < PHI_DIM; ++i) {
        phi_lanes even = { 0.0 }, odd = { 0.0 };
        for (int k = 1; k < e->terms; k += 2) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) {
                odd[lane] += (double)k * e->s[i][k][lane];
                even[lane] += (double)(k + 1) * e->s[i][k + 1][lane];
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

/* Start the expansions of the paths whose mean is y, at the present estimates y + middle of their middles. */
static void phi_begin_at(phi_lanes coef[restrict], phi_lanes y[restrict PHI_DIM], phi_lanes middle[restrict PHI_DIM],
    phi_expansion *e)
{
    phi_lanes m[PHI_DIM];
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) m[i][lane] = y[i][lane] + middle[i][lane];
    }
    phi_begin(coef, e, m);
}

/* Find the middles of the paths whose mean is y, as y + `middle`, by iteration. Each iteration gains some digits, and sums no
   more terms than these digits need; the last expansion can be extended. `middle` becomes infinite in lanes that do not
   converge. */
static void phi_find_middles(phi_lanes coef[restrict], phi_lanes y[restrict PHI_DIM], phi_lanes middle[restrict PHI_DIM],
    phi_expansion *e, double accuracy)
{
    phi_lanes size, norm;
    double left = 1.0;
    memset(middle, 0, PHI_DIM * sizeof middle[0]);
    for (int round = 0; left > accuracy && round < PHI_ROUNDS; ++round) {
        for (int i = 0; i < PHI_DIM && round > 0; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) middle[i][lane] = -e->mean[i][lane];
        }
        phi_begin_at(coef, y, middle, e);
        phi_extend(coef, e, PHI_GAIN_OF_ROUND * left);
        memset(size, 0, sizeof size);
        memset(norm, 0, sizeof norm);
        for (int i = 0; i < PHI_DIM; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) {
                size[lane] += fabs(middle[i][lane] + e->mean[i][lane]);
                norm[lane] += fabs(y[i][lane]);
            }
        }
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) size[lane] /= norm[lane] + DBL_MIN;
        left = phi_largest_finite(size);
        if (left > 1.0) left = 1.0;
    }
    for (int lane = 0; lane < PHI_LANES && left > accuracy; ++lane)
        if (!(size[lane] <= accuracy)) middle[0][lane] = HUGE_VAL;
}

/* Halve p, since the time of the paths goes from -1 to 1. */
static void phi_halve(phi_lanes p[restrict PHI_DIM])
{
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) p[i][lane] *= 0.5;
    }
}

/* Compute order k + 1 of the series of the derivatives by middle and p; order 0 is 1 for the middle, and 0 for p. */
static void phi_vary_order(phi_expansion *e, int k)
{
    memset(e->v[k + 1], 0, 2 * PHI_DIM * PHI_DIM * sizeof e->v[0][0]);
    phi_vary_source(e, k);
    for (int j = 0; j < k; ++j) phi_vary_by(e, j, k);
}

/* Add the terms of the orders k and k + 1 to the sums for the derivatives; k is odd. `size` receives the
   magnitudes of these terms; for derivatives by p, they are relative to the terms of order 1. */
static void phi_add_slopes(phi_expansion *e, int k, phi_lanes size)
{
    phi_lanes parts[2] = { { 0.0 } }, first = { 0.0 };
    const double share = 1.0 / (double)(k + 2);
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

/* Compute the derivatives of the paths by their middles and by p. They become infinite in lanes where PHI_SLOPE_TERMS
   terms do not suffice. */
static void phi_vary(phi_lanes coef[restrict], phi_expansion *e, double accuracy)
{
    phi_lanes slope[PHI_SLOPE_SERIES], size;
    double largest = 1.0, next = 1.0; /* size of the terms of the last two orders, and expected size of the next two */
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
    for (e->varied = 0; e->varied < PHI_SLOPE_TERMS && next > accuracy; ++e->varied) {
        const int k = e->varied;
        if (k >= e->terms) phi_next_order(coef, e, k);
        if (k > 0) phi_follow_slopes(coef, e, k);
        phi_vary_order(e, k);
        if (k % 2 == 0) continue;
        phi_add_slopes(e, k, size);
        const double previous = largest;
        largest = phi_largest_finite(size);
        next = largest * (largest / previous);
    }
    for (int lane = 0; lane < PHI_LANES && next > accuracy; ++lane)
        if (!(size[lane] <= accuracy)) e->v_mean[0][lane] = HUGE_VAL;
}
#endif
