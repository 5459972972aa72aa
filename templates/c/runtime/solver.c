#ifndef PHI_FILE_SOLVER
#define PHI_FILE_SOLVER
#include <math.h>
#include <string.h>

#include "solver.h"
#if PHI_NEWTON
#include "newton.c"
#elif PHI_PATH
#include "path.c"
#elif PHI_GAUSS
#include "gauss.c"
#else
#include "explicit.c"
#endif
#if PHI_ATTITUDE
#include "attitude.c"
#endif
#if PHI_MONITOR
#include "level.c"
#elif PHI_GAUGE_SEARCH
#include "gauge.c"
#endif
#if PHI_BLOCKS
#include <limits.h>
#endif

#if PHI_NOISE
#include "noise.c"
#endif

#if !PHI_EXPLICIT
/* ---- The solver ---- */
#endif
#if PHI_GAUGE && !PHI_MONITOR && !PHI_GAUGE_SEARCH
#include "gauge.c"

#endif
/* The arguments may be parts of *s, which is therefore written last. */
#if PHI_GAUGE
phi_status phi_init_gauge(phi_solver *s, const phi_params *params, const double x0[PHI_DIM],
    const double gauge[PHI_GAUGES])
#elif PHI_TIMED
phi_status phi_init_at(phi_solver *s, const phi_params *params, const double x0[PHI_DIM], double t0)
#else
phi_status phi_init(phi_solver *s, const phi_params *params, const double x0[PHI_DIM])
#endif
{
#if PHI_TIMED
    if (s == NULL || x0 == NULL || !isfinite(t0)) return PHI_BAD_ARGUMENT;
#else
    if (s == NULL || x0 == NULL) return PHI_BAD_ARGUMENT;
#endif
    if (params == NULL) params = &phi_default_params;
    phi_solver fresh;
    memset(&fresh, 0, sizeof fresh);
    fresh.h = (double)NAN;
    fresh.params = *params;
    memcpy(fresh.x, x0, sizeof fresh.x);
#if PHI_TIMED
    fresh.t = t0;
#endif
#if PHI_PARAMETERS
#if PHI_GAUGE
    phi_prepare(&fresh.params, fresh.gauge, 1e-100, PHI_OF(fresh.coef, 0)); /* so short a step does not matter */
#else
    phi_prepare(&fresh.params, 1e-100, PHI_OF(fresh.coef, 0)); /* so short a step does not matter */
#endif
    if (!phi_finite(fresh.x, PHI_DIM) || !phi_allowed(&fresh.params) || !phi_finite(PHI_OF(fresh.coef, 0), PHI_COEFFICIENTS))
        return PHI_BAD_ARGUMENT;
#else
    if (!phi_finite(fresh.x, PHI_DIM)) return PHI_BAD_ARGUMENT;
#endif
#if PHI_GAUGE
    if (gauge == NULL) phi_choose_gauge(&fresh.params, fresh.x, fresh.gauge);
    else memcpy(fresh.gauge, gauge, sizeof fresh.gauge);
    if (!phi_finite(fresh.gauge, PHI_GAUGES)) return PHI_BAD_ARGUMENT;
#endif
#if PHI_MONITOR
    const double rate = phi_monitor(&fresh.params, fresh.x);
    if (!isfinite(rate) || !(rate > 0.0)) return PHI_BAD_ARGUMENT;
#endif
#if PHI_ATTITUDE
    double identity[PHI_ELEMENT] = { 1.0 };
#if PHI_MATRICES
    for (int i = 0; i < PHI_ELEMENT; i += PHI_ROWS_OF_ATTITUDE + 1) identity[i] = 1.0;
#endif
    phi_begin_attitude(&fresh, identity);
#endif
    *s = fresh;
    return PHI_OK;
}

#if PHI_GAUGE
phi_status phi_init(phi_solver *s, const phi_params *params, const double x0[PHI_DIM])
{
    return phi_init_gauge(s, params, x0, NULL);
}

#endif
#if PHI_TIMED
phi_status phi_init(phi_solver *s, const phi_params *params, const double x0[PHI_DIM])
{
    return phi_init_at(s, params, x0, 0.0);
}

#endif
#if PHI_RENEWED
#if PHI_NOISE
/* What depends on the increments of the next step. */
#else
/* What depends on the time of the next step. */
#endif
static void phi_renew(phi_solver *s)
{
#if PHI_SPLITTING
    for (int k = 0; k < PHI_ROWS_OF_FLOWS; ++k) {
        double *row = s->coef + k * PHI_ROW;
#if PHI_NOISE
        const int late = k - (PHI_ROWS_OF_FLOWS - PHI_DRAWS); /* in the half after the flows of H */
        const double dw[1] = { k < PHI_SOURCES ? s->dw[k] : late >= PHI_SOURCES ? s->dw[late] : 0.0 };
#endif
#if PHI_NOISE && PHI_TIMED
        phi_at_step(row, s->t + phi_moments[k] * s->h, dw, row + PHI_PREPARED);
#elif PHI_NOISE
        phi_at_step(row, dw, row + PHI_PREPARED);
#else
        phi_at_time(row, s->t + phi_moments[k] * s->h, row + PHI_PREPARED);
#endif
    }
#else
    PHI_EACH_STAGE
#if PHI_NOISE && PHI_TIMED
        phi_at_step(PHI_OF(s->coef, stage), s->t + PHI_OF(phi_middles, stage) * s->h, s->dw, PHI_OF(s->coef, stage) + PHI_PREPARED);
#elif PHI_NOISE
        phi_at_step(PHI_OF(s->coef, stage), s->dw, PHI_OF(s->coef, stage) + PHI_PREPARED);
#else
        phi_at_time(PHI_OF(s->coef, stage), s->t + PHI_OF(phi_middles, stage) * s->h, PHI_OF(s->coef, stage) + PHI_PREPARED);
#endif
#endif
}

#endif
#if PHI_GUESSED
/* One stage. A guess from earlier steps may have misled it: then once more without. */
static phi_status phi_stage(phi_solver *s PHI_AND_INT_STAGE)
{
    const phi_status status = phi_attempt(s PHI_AND_STAGE);
    if (status == PHI_OK || PHI_OF(s->history, stage).count == 0) return status;
    memset(&PHI_OF(s->history, stage), 0, sizeof PHI_OF(s->history, stage));
    return phi_attempt(s PHI_AND_STAGE);
}

#elif PHI_IMPLICIT
/* One stage. */
static phi_status phi_stage(phi_solver *s PHI_AND_INT_STAGE) { return phi_attempt(s PHI_AND_STAGE); }

#endif
#if PHI_COMPOSED
/* The stages of one step. If one fails, the state is as before the step. */
static phi_status phi_stages(phi_solver *s)
{
    double x[PHI_DIM], carry[PHI_DIM];
    phi_status status = PHI_OK;
#if PHI_MONITOR
    const double t = s->t, t_carry = s->t_carry;
#endif
    memcpy(x, s->x, sizeof x);
    memcpy(carry, s->carry, sizeof carry);
#if PHI_ATTITUDE
    double turned[PHI_ELEMENT], turned_carry[PHI_ELEMENT];
    memcpy(turned, s->turned, sizeof turned);
    memcpy(turned_carry, s->turned_carry, sizeof turned_carry);
#endif
    for (int stage = 0; stage < PHI_STAGES && status == PHI_OK; ++stage) status = phi_stage(s, stage);
    if (status != PHI_OK) {
        memcpy(s->x, x, sizeof x);
        memcpy(s->carry, carry, sizeof carry);
#if PHI_ATTITUDE
        memcpy(s->turned, turned, sizeof turned);
        memcpy(s->turned_carry, turned_carry, sizeof turned_carry);
#endif
#if PHI_MONITOR
        s->t = t;
        s->t_carry = t_carry;
#endif
    }
    return status;
}

#endif
#if PHI_BLOCKS
#if PHI_ATTITUDE
/* Steps one by one; s->attitude is left to phi_read_attitude. */
#else
/* Steps one by one. */
#endif
static phi_status phi_single_steps(phi_solver *s, double h, size_t steps)
#elif PHI_NOISE
phi_status phi_integrate_along(phi_solver *s, double h, size_t steps, const double *dw)
#elif PHI_SPLITTING && PHI_ADJOINT
/* phi_integrate, which leaves the states before all flows in kept, unless that is NULL. */
static phi_status phi_integrate_leaving(phi_solver *s, double h, size_t steps, double (*kept)[PHI_DIM])
#else
phi_status phi_integrate(phi_solver *s, double h, size_t steps)
#endif
{
    if (s == NULL || !isfinite(h)) return PHI_BAD_ARGUMENT;
    if (memcmp(&h, &s->h, sizeof h) != 0) { /* what depends on the step size */
        PHI_EACH_STAGE
#if PHI_GAUGE
            phi_prepare(&s->params, s->gauge, PHI_FRACTION(h), PHI_OF(s->coef, stage));
#else
            phi_prepare(&s->params, PHI_FRACTION(h), PHI_OF(s->coef, stage));
#endif
#if PHI_GUESSED
        memset(&s->history, 0, sizeof s->history);
#endif
#if PHI_RECURRENCES
        PHI_EACH_STAGE PHI_OF(s->history, stage).slow_steps_allowed = PHI_REPAY;
#endif
#if PHI_BLOCKS
        memset(&s->blocks, 0, sizeof s->blocks);
        s->blocks.single_steps = 2 * PHI_AHEAD;
        s->blocks.passes_without_recurrences = INT_MAX;
#endif
        s->h = h;
#if PHI_RATE_OF_GAUGE
        phi_set_aside(s);
#endif
#if !PHI_MONITOR
        s->t_before_h = s->t;
        s->steps_before_h = s->steps;
#endif
    }
    for (; steps > 0; --steps) {
#if PHI_NOISE && PHI_ATTITUDE
        if (!phi_draw(s, dw)) {
            phi_read_attitude(s);
            return PHI_BAD_ARGUMENT;
        }
#elif PHI_NOISE
        if (!phi_draw(s, dw)) return PHI_BAD_ARGUMENT;
#endif
#if PHI_NOISE
        if (dw != NULL) dw += PHI_DRAWS;
#endif
#if PHI_RENEWED
        phi_renew(s);
#endif
#if PHI_EXPLICIT && !PHI_COMPOSED
        double increment[PHI_DIM];
        phi_explicit(s->coef, s->x, increment);
        ++s->evaluations;
        if (!phi_advance(s, increment, s->carry)) return PHI_NOT_FINITE;
#else
#if PHI_SPLITTING && PHI_ADJOINT
        const phi_status status = phi_stages(s, kept);
        if (kept != NULL) kept += PHI_FLOWS;
#elif PHI_COMPOSED || PHI_SPLITTING
        const phi_status status = phi_stages(s);
#else
        const phi_status status = phi_stage(s);
#endif
#if PHI_ATTITUDE && !PHI_BLOCKS
        if (status != PHI_OK) phi_read_attitude(s);
#endif
        if (status != PHI_OK) return status;
#endif
        ++s->steps;
#if PHI_MONITOR
    }
#else
        s->t = s->t_before_h + (double)(s->steps - s->steps_before_h) * s->h;
    }
#endif
#if PHI_ATTITUDE && !PHI_BLOCKS
    phi_read_attitude(s);
#endif
    return PHI_OK;
}

#if PHI_BLOCKS && PHI_ATTITUDE
phi_status phi_step(phi_solver *s, double h)
{
    const phi_status status = phi_single_steps(s, h, 1);
    if (status == PHI_OK) phi_read_attitude(s);
    return status;
}

#elif PHI_BLOCKS
phi_status phi_step(phi_solver *s, double h) { return phi_single_steps(s, h, 1); }

#else
#if PHI_NOISE
phi_status phi_integrate(phi_solver *s, double h, size_t steps) { return phi_integrate_along(s, h, steps, NULL); }

#elif PHI_SPLITTING && PHI_ADJOINT
phi_status phi_integrate(phi_solver *s, double h, size_t steps) { return phi_integrate_leaving(s, h, steps, NULL); }

#endif
phi_status phi_step(phi_solver *s, double h) { return phi_integrate(s, h, 1); }

#endif
#if PHI_KICKED
#include "placing.c"

#endif
#include "status.c"

size_t phi_solver_size(void) { return sizeof(phi_solver); }
size_t phi_solver_steps_done(const phi_solver *s) { return s->steps; }
#if PHI_MONITOR
double phi_solver_time(const phi_solver *s) { return s->t + s->t_carry; }
#endif
#endif
