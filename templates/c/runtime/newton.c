#ifndef PHI_FILE_NEWTON
#define PHI_FILE_NEWTON
#include <float.h>
#include <math.h>
#include <string.h>

#include "algebra.c"
#include "implicit.c"
#include "attitude.c"
#include "model.h"

/* ---- The implicit step, by Newton's method ---- */
/* A step leads from x = alpha(y) to beta(y); the unknown is the point y between them. */
#include "measure_policy.h"
#include "newton_policy.h"

/* Largest relative component of the correction delta of y; NaN or infinite if a component is. */
static double phi_size(const double y[PHI_DIM], const double delta[PHI_DIM])
{
    double norm = 0.0, size = 0.0;
    for (int i = 0; i < PHI_DIM; ++i) norm = fabs(y[i]) > norm ? fabs(y[i]) : norm;
    for (int i = 0; i < PHI_DIM; ++i) {
        const double ratio = fabs(delta[i]) / (fabs(y[i]) + PHI_FLOOR * norm + DBL_MIN);
        if (!isfinite(ratio)) return ratio;
        size = ratio > size ? ratio : size;
    }
    return size;
}

/* Solve (y - x) + displacement(y) = 0 for y by Newton's method, and add the increment to x. The last correction of y enters
   the increment to first order, without another evaluation: iterations end as soon as the next correction is expected to be
   below PHI_TOLERANCE. */
static phi_status phi_attempt(phi_solver *s PHI_AND_INT_STAGE)
{
    double y[PHI_DIM], delta[PHI_DIM], displacement[PHI_DIM], increment[PHI_DIM];
    double jacobian[PHI_DIM * PHI_DIM], slope[PHI_DIM * PHI_DIM];
    double previous = HUGE_VAL;
#if PHI_PREDICTED
    if (!phi_predict(&PHI_OF(s->history, stage), y)) PHI_COPY(y, s->x, y, PHI_DIM);
#else
    PHI_COPY(y, s->x, y, PHI_DIM);
#endif
    for (int iteration = 1; iteration <= PHI_MAX_ITERATIONS; ++iteration) {
        phi_linearise(PHI_OF(PHI_COEFFICIENTS_OF(s), stage), y, displacement, increment, jacobian, slope);
        ++s->evaluations;
        for (int i = 0; i < PHI_DIM; ++i) delta[i] = ((y[i] - s->x[i]) + displacement[i]) - s->carry[i];
        const int regular = phi_solve(jacobian, delta);
        const double size = phi_size(y, delta), growth = size / (previous * previous);
        if (!isfinite(size)) return PHI_NOT_FINITE;
        if (!regular) return PHI_SINGULAR;
        for (int i = 0; i < PHI_DIM; ++i) y[i] -= delta[i];
        const double remaining = size * size * (growth > 1.0 ? growth : 1.0);
        const int stalled = previous < PHI_NEARLY_SOLVED && size > PHI_SHRINKING * previous;
        previous = size;
        if (!(remaining <= PHI_TOLERANCE || stalled)) continue;
#if PHI_ATTITUDE
        double factor[PHI_ELEMENT]; /* computed here, so that the processor overlaps it with the lines below */
        phi_factor(s PHI_AND_STAGE, y, factor);
#endif
        double rest[PHI_DIM] = { 0.0 }; /* correction of the increment, plus the compensation term */
        for (int i = 0; i < PHI_DIM; ++i)
            for (int j = 0; j < PHI_DIM; ++j) rest[i] -= slope[i * PHI_DIM + j] * delta[j];
        for (int i = 0; i < PHI_DIM; ++i) rest[i] += s->carry[i];
        if (!phi_plausible(s PHI_AND_STAGE, increment)) return PHI_NO_CONVERGENCE;
#if PHI_MONITOR
        double elapsed[1];
        phi_elapsed(PHI_OF(s->coef, stage), y, elapsed);
        if (!(elapsed[0] * (PHI_FRACTION(s->h)) > 0.0)) return PHI_NOT_FINITE;
#endif
        if (!phi_advance(s, increment, rest)) return PHI_NOT_FINITE;
        PHI_PASS(s, elapsed[0])
        phi_remember(&PHI_OF(s->history, stage), y PHI_AND_ITERATION);
#if PHI_ATTITUDE
        phi_turn_by(s, factor PHI_AND_ASIDE(s->aside));
#endif
        return PHI_OK;
    }
    return PHI_NO_CONVERGENCE;
}
#endif
