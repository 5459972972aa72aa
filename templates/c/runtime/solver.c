#ifndef PHI_FILE_SOLVER
#define PHI_FILE_SOLVER
#include <math.h>
#include <string.h>

#include "solver.h"
#include "start_policy.h"
#include "newton.c"
#include "path.c"
#include "gauss.c"
#include "explicit.c"
#include "attitude.c"
#include "level.c"
#include "gauge.c"
#if PHI_BLOCKS
#include <limits.h>
#endif

#include "noise.c"

#if !PHI_EXPLICIT
/* ---- The solver ---- */
#endif
#include "gauge_formula.c"

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
    if (s == NULL || x0 == NULL PHI_OR_NO_T0) return PHI_BAD_ARGUMENT;
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
    phi_prepare(&fresh.params PHI_AND_GAUGE(fresh.gauge), PHI_PROBE_STEP, PHI_OF(fresh.coef, 0));
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
        PHI_RENEWAL(row PHI_AND_T(s->t + phi_moments[k] * s->h) PHI_AND_DW(dw), row + PHI_PREPARED);
    }
#else
    PHI_EACH_STAGE
        PHI_RENEWAL(PHI_OF(s->coef, stage) PHI_AND_T(s->t + PHI_OF(phi_middles, stage) * s->h) PHI_AND_DW(s->dw), PHI_OF(s->coef, stage) + PHI_PREPARED);
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
    phi_status status = PHI_OK;
#include "state_saved.h"
    for (int stage = 0; stage < PHI_STAGES && status == PHI_OK; ++stage) status = phi_stage(s, stage);
    if (status != PHI_OK) {
#include "state_restored.h"
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
            phi_prepare(&s->params PHI_AND_GAUGE(s->gauge), PHI_FRACTION(h), PHI_OF(s->coef, stage));
#include "state_reset.h"
    }
#if PHI_CORRECTED
    const phi_solver before = *s;
    if (steps > 0) {
        const phi_status status = phi_correct(s, 0);
        if (status != PHI_OK) return status;
    }
#endif
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
#if PHI_CORRECTED
        if (status != PHI_OK) return phi_end_run(s, &before, status);
#else
        if (status != PHI_OK) return status;
#endif
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
#if PHI_CORRECTED
    return phi_end_run(s, &before, PHI_OK);
#else
    return PHI_OK;
#endif
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
#include "placing.c"

#include "status.c"

size_t phi_solver_size(void) { return sizeof(phi_solver); }
size_t phi_solver_steps_done(const phi_solver *s) { return s->steps; }
#if PHI_MONITOR
double phi_solver_time(const phi_solver *s) { return s->t + s->t_carry; }
#endif
#endif
