#ifndef PHI_FILE_SOLVER
#define PHI_FILE_SOLVER
#include <math.h>
#include <string.h>

#include "solver.h"
#if PHI_NEWTON
#include "newton.c"
#elif PHI_PATH
#include "path.c"
#else
#include "explicit.c"
#endif
#if PHI_GAUGE
#include "gauge.c"
#endif
#if PHI_BLOCKS
#include <limits.h>

#include "lanes.c"
#endif

/* ---- The solver ---- */
#if PHI_PARAMETERS
/* Whether steps can be made with these parameters: allowed, and with finite coefficients for a step so short that it has
   no part in it. */
static int phi_admissible(const phi_params *params)
{
    double coef[PHI_COEFFICIENTS];
    if (!phi_allowed(params)) return 0;
#if PHI_GAUGE
    phi_prepare(params, (const double[PHI_GAUGES]){ 0.0 }, 1e-100, coef);
#else
    phi_prepare(params, 1e-100, coef);
#endif
    for (int k = 0; k < PHI_COEFFICIENTS; ++k)
        if (!isfinite(coef[k])) return 0;
    return 1;
}

#endif
/* The arguments may be parts of *s: they are read before it is written. */
#if PHI_GAUGE
phi_status phi_init_gauge(phi_solver *s, const phi_params *params, const double x0[PHI_DIM],
    const double gauge[PHI_GAUGES])
#else
phi_status phi_init(phi_solver *s, const phi_params *params, const double x0[PHI_DIM])
#endif
{
    if (s == NULL || x0 == NULL) return PHI_BAD_ARGUMENT;
    const phi_params own = params != NULL ? *params : phi_default_params;
    double x[PHI_DIM];
    memcpy(x, x0, sizeof x);
    for (int i = 0; i < PHI_DIM; ++i)
        if (!isfinite(x[i])) return PHI_BAD_ARGUMENT;
#if PHI_GAUGE
    double multiples[PHI_GAUGES] = { 0.0 };
    const int given = gauge != NULL;
    if (given) memcpy(multiples, gauge, sizeof multiples);
    for (int c = 0; c < PHI_GAUGES; ++c)
        if (!isfinite(multiples[c])) return PHI_BAD_ARGUMENT;
#endif
#if PHI_PARAMETERS
    if (!phi_admissible(&own)) return PHI_BAD_ARGUMENT;
#endif
    memset(s, 0, sizeof *s);
    memcpy(s->x, x, sizeof s->x);
    s->params = own;
#if PHI_GAUGE
    if (!given) phi_choose_gauge(&own, x, multiples);
    memcpy(s->gauge, multiples, sizeof s->gauge);
#endif
    return PHI_OK;
}

#if PHI_GAUGE
phi_status phi_init(phi_solver *s, const phi_params *params, const double x0[PHI_DIM])
{
    return phi_init_gauge(s, params, x0, NULL);
}

#endif
/* What depends on the step size; nothing where that is as before. */
static phi_status phi_set_step(phi_solver *s, double h)
{
    if (s == NULL || !isfinite(h)) return PHI_BAD_ARGUMENT;
    if (s->prepared && memcmp(&h, &s->h, sizeof h) == 0) return PHI_OK;
    for (int stage = 0; stage < PHI_STAGES; ++stage)
#if PHI_GAUGE
        phi_prepare(&s->params, s->gauge, phi_fractions[stage] * h, s->coef[stage]);
#else
        phi_prepare(&s->params, phi_fractions[stage] * h, s->coef[stage]);
#endif
#if PHI_IMPLICIT
    memset(&s->history, 0, sizeof s->history);
#endif
#if PHI_RECURRENCES
    for (int stage = 0; stage < PHI_STAGES; ++stage) s->history[stage].slow_steps_allowed = PHI_REPAY;
#endif
#if PHI_BLOCKS
    memset(&s->blocks, 0, sizeof s->blocks);
    s->blocks.single_steps = 2 * PHI_LANES;
    s->blocks.passes_without_recurrences = INT_MAX;
#endif
    s->h = h;
    s->t_before_h = s->t;
    s->steps_before_h = s->steps;
    s->prepared = 1;
    return PHI_OK;
}

#if PHI_BLOCKS
/* Some good steps have been made. */
static void phi_count(phi_solver *s, size_t steps)
{
    s->steps += steps;
    s->t = s->t_before_h + (double)(s->steps - s->steps_before_h) * s->h;
}

#endif
#if PHI_IMPLICIT
/* One stage. A guess from earlier steps may have misled it: then once more without. */
static phi_status phi_stage(phi_solver *s, int stage)
{
    phi_status status = phi_attempt(s, stage);
    if (status != PHI_OK && s->history[stage].count > 0) {
        memset(&s->history[stage], 0, sizeof s->history[stage]);
        status = phi_attempt(s, stage);
    }
    return status;
}

#endif
#if PHI_COMPOSED
/* The stages of one step. If one fails, the state is as before the step. */
static phi_status phi_stages(phi_solver *s)
{
    double x[PHI_DIM], carry[PHI_DIM];
    phi_status status = PHI_OK;
    memcpy(x, s->x, sizeof x);
    memcpy(carry, s->carry, sizeof carry);
    for (int stage = 0; stage < PHI_STAGES && status == PHI_OK; ++stage) status = phi_stage(s, stage);
    if (status != PHI_OK) {
        memcpy(s->x, x, sizeof x);
        memcpy(s->carry, carry, sizeof carry);
    }
    return status;
}

#endif
phi_status phi_step(phi_solver *s, double h)
{
    phi_status status = phi_set_step(s, h);
    if (status != PHI_OK) return status;
#if PHI_COMPOSED || PHI_SPLITTING
    status = phi_stages(s);
#else
    for (int stage = 0; stage < PHI_STAGES; ++stage) status = phi_stage(s, stage);
#endif
#if PHI_BLOCKS
    if (status == PHI_OK) phi_count(s, 1);
#else
    if (status != PHI_OK) return status;
    ++s->steps;
    s->t = s->t_before_h + (double)(s->steps - s->steps_before_h) * s->h;
#endif
    return status;
}

#if !PHI_BLOCKS
phi_status phi_integrate(phi_solver *s, double h, size_t steps)
{
    phi_status status = phi_set_step(s, h);
    for (; steps > 0 && status == PHI_OK; --steps) status = phi_step(s, h);
    return status;
}

#endif
const char *phi_status_string(phi_status status)
{
    switch (status) { /* no table, which would be data to relocate */
    case PHI_OK: return "ok";
    case PHI_NO_CONVERGENCE: return "no convergence: the step is too large";
    case PHI_SINGULAR: return "singular Newton matrix: the step is too large";
    case PHI_NOT_FINITE: return "not finite: overflow, or outside the domain";
    case PHI_BAD_ARGUMENT: return "bad argument: a null pointer, or values that are not allowed";
    }
    return "unknown status";
}

size_t phi_solver_size(void) { return sizeof(phi_solver); }

size_t phi_solver_steps_done(const phi_solver *s) { return s->steps; }
#endif
