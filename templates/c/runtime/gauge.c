#ifndef PHI_FILE_GAUGE
#define PHI_FILE_GAUGE
#include <float.h>
#include <math.h>
#include <string.h>

#include "model.h"

/* ---- The choice of the gauge: factors of Casimirs, whose multiples are subtracted from H ---- */
#include "gauge_search.h"

/* Compute the direction of the vector field at a point, a unit vector; 0 at equilibria. */
static void phi_direction(const phi_params *params, const double at[PHI_DIM], double direction[PHI_DIM])
{
    double speed = DBL_MIN;
    phi_vector_field(params, at, direction);
    for (int i = 0; i < PHI_DIM; ++i) speed += fabs(direction[i]);
    for (int i = 0; i < PHI_DIM; ++i) direction[i] /= speed;
}

/* Sample a short piece of the trajectory from x, by a Runge-Kutta method whose steps have equal length in phase space.
   With steps of equal time, a trajectory that starts slowly would soon be far away. */
static void phi_sample(const phi_params *params, const double x[PHI_DIM], double samples[][PHI_DIM])
{
    double direction[PHI_DIM], middle[PHI_DIM], length = 0.0;
    for (int i = 0; i < PHI_DIM; ++i) {
        samples[0][i] = x[i];
        length += PHI_SAMPLE_LENGTH * fabs(x[i]);
    }
    for (int k = 1; k < PHI_SAMPLES; ++k) {
        const double *y = samples[k - 1];
        phi_direction(params, y, direction);
        for (int i = 0; i < PHI_DIM; ++i) middle[i] = y[i] + 0.5 * length * direction[i];
        phi_direction(params, middle, direction);
        for (int i = 0; i < PHI_DIM; ++i) samples[k][i] = y[i] + length * direction[i];
    }
}

/* The leading error of the method with this gauge: the sum of |pi grad S_3|^2 over the samples, where S_3 is the first
   error term in the Hamiltonian that steps follow (the modified Hamiltonian). */
static double phi_gauge_error(const phi_params *params, const double gauge[PHI_GAUGES], double samples[][PHI_DIM])
{
    double error[PHI_DIM], sum = 0.0;
    for (int k = 0; k < PHI_SAMPLES; ++k) {
        phi_guide(params, gauge, samples[k], error);
        for (int i = 0; i < PHI_DIM; ++i) sum += error[i] * error[i];
    }
    return sum;
}

/* The error at gauge[c] + t * width (see phi_least_on_line). This polynomial in t is computed by Newton's formula from
   its forward differences. */
static double phi_on_line(const double difference[PHI_DEGREE + 1], double t)
{
    double error = difference[PHI_DEGREE];
    for (int k = PHI_DEGREE - 1; k >= 0; --k) error = difference[k] + (t + PHI_DEGREE / 2 - k) / (k + 1) * error;
    return error;
}

/* Return the shift of gauge[c] that minimises the error, as a multiple of `width`. The search uses successively finer
   grids. */
static double phi_least_on_line(const phi_params *params, const double gauge[PHI_GAUGES], int c, double width,
    double samples[][PHI_DIM])
{
    double changed[PHI_GAUGES], difference[PHI_DEGREE + 1], size = 0.0, best = 0.0, mesh = PHI_MESH;
    memcpy(changed, gauge, sizeof changed);
    for (int j = 0; j <= PHI_DEGREE; ++j) {
        changed[c] = gauge[c] + (j - PHI_DEGREE / 2) * width;
        difference[j] = phi_gauge_error(params, changed, samples);
        size += difference[j];
    }
    for (int order = 1; order <= PHI_DEGREE; ++order)
        for (int j = PHI_DEGREE; j >= order; --j) difference[j] -= difference[j - 1];
    double least = phi_on_line(difference, best);
    for (int level = 0; level < PHI_GRIDS; ++level, mesh *= PHI_MESH) {
        const int reach = level == 0 ? PHI_FIRST_REACH : PHI_REACH_OF_GRID;
        const double centre = best;
        for (int j = -reach; j <= reach; ++j) {
            const double t = centre + j * mesh, error = phi_on_line(difference, t);
            if (!(error < least - PHI_CLOSE_CALL * size)) continue;
            least = error;
            best = t;
        }
    }
    return best;
}

/* Compute the gauge: factors of Casimirs C that minimise the leading error along a short piece of the trajectory from
   x. They are optimised one after the other, starting from the least-squares solution of grad H = sum of gauge[c] grad
   C_c. All factors are 0 if the error that they give is not finite. */
static void phi_choose_gauge(const phi_params *params, const double x[PHI_DIM], double gauge[PHI_GAUGES])
{
    double samples[PHI_SAMPLES][PHI_DIM], out[1 + 2 * PHI_GAUGES], sums[1 + 2 * PHI_GAUGES] = { 0.0 };
    double width[PHI_GAUGES];
    phi_sample(params, x, samples);
    for (int k = 0; k < PHI_SAMPLES; ++k) {
        phi_products(params, samples[k], out);
        for (int i = 0; i < 1 + 2 * PHI_GAUGES; ++i) sums[i] += out[i];
    }
    for (int c = 0; c < PHI_GAUGES; ++c) {
        const double norm = sums[2 + 2 * c] > 0.0 ? sums[2 + 2 * c] : HUGE_VAL;
        gauge[c] = sums[1 + 2 * c] / norm;
        width[c] = sqrt(sums[0] / norm);
    }
    for (int sweep = 0, changed = 1; sweep < PHI_SWEEPS && changed; ++sweep) {
        changed = 0;
        for (int c = 0; c < PHI_GAUGES; ++c) {
            const double best = phi_least_on_line(params, gauge, c, width[c], samples);
            gauge[c] += best * width[c];
            changed = changed || best != 0.0;
        }
    }
    if (!isfinite(phi_gauge_error(params, gauge, samples))) memset(gauge, 0, PHI_GAUGES * sizeof gauge[0]);
}
#endif
