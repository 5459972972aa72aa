#ifndef PHI_FILE_ADJOINT
#define PHI_FILE_ADJOINT
#include <math.h>
#include <string.h>

#include "adjoint_stage.c"
#include "adjoint_gauss.c"
#include "algebra.c"
#include "model.h"
#include "solver.c"
#include "adjoint_lanes.c"

/* Go back to where the step begins that led to s, but for the state. */
static void phi_go_back(phi_solver *s)
{
    --s->steps;
#if !PHI_MONITOR
    s->t = s->t_before_h + (double)(s->steps - s->steps_before_h) * s->h;
#endif
#if PHI_RENEWED
    phi_renew(s);
#endif
}

/* What the row that a run has after so many steps adds to the cotangent. */
static void phi_join(phi_cotangent *bar, const double *rows_bar, size_t done, size_t steps, size_t stride)
{
    if (done != steps && done % stride != 0) return;
    const double *row = rows_bar + (done + stride - 1) / stride * PHI_DIM - PHI_DIM;
    for (int i = 0; i < PHI_DIM; ++i) bar->x[i] += row[i];
}

#if PHI_TRACED
/* Pull cotangents of rows back through a run that ended at s and left its trail, many stages at once. */
static phi_status phi_back(phi_solver *s, size_t steps, size_t stride, const double *rows_bar,
    phi_kept *trail, phi_cotangent *bar)
{
    phi_traced g;
    phi_lanes coef[PHI_COEFFICIENTS], slopes[PHI_COEFFICIENTS];
    phi_status status = PHI_OK;
    size_t at = steps; /* the step that s is before */
    g.coef = coef;
    memset(g.after, 0, sizeof g.after);
    memset(g.change, 0, sizeof g.change);
    for (size_t left = PHI_ALL_STAGES(steps); left > 0 && status == PHI_OK;) {
        const int count = left < PHI_LANES ? (int)left : PHI_LANES;
        for (int lane = PHI_LANES - 1; lane >= 0; --lane) { /* lanes without a stage of their own repeat the last */
            const size_t k = left - (size_t)count + (size_t)(lane < count ? lane : count - 1);
#if PHI_COMPOSED
            const int stage = (int)(k % PHI_STAGES);
            for (; at > k / PHI_STAGES; --at) phi_go_back(s);
            phi_load(&g, lane, s, stage, trail[k / PHI_STAGES][stage]);
#else
            for (; at > k; --at) phi_go_back(s);
            PHI_EACH_STAGE phi_load(&g, lane, s PHI_AND_STAGE, PHI_OF(trail[k], stage));
#endif
        }
        phi_linearise_back(&g);
        phi_solve_lanes(g.jacobian, g.gain, PHI_DIM, g.wrong); /* for any cotangents, which are not known yet */
        for (int lane = count - 1; lane >= 0 && status == PHI_OK; --lane) {
            const size_t k = left - (size_t)count + (size_t)lane;
#if PHI_COMPOSED
            const int stage = (int)(k % PHI_STAGES);
            if (stage == PHI_STAGES - 1) phi_join(bar, rows_bar, k / PHI_STAGES + 1, steps, stride);
            status = phi_through(&g, lane, bar, bar->coef[stage]);
#else
            phi_join(bar, rows_bar, k + 1, steps, stride);
            PHI_EACH_STAGE status = phi_through(&g, lane, bar, PHI_OF(bar->coef, stage));
#endif
        }
        for (int lane = count; lane < PHI_LANES; ++lane) g.wrong[lane] = HUGE_VAL;
        phi_slopes_back(&g, slopes);
        for (int lane = 0; lane < count; ++lane)
#if PHI_COMPOSED
            phi_gather(&g, slopes, lane, bar->coef[(left - (size_t)count + (size_t)lane) % PHI_STAGES]);
#else
            phi_gather(&g, slopes, lane, bar->coef);
#endif
        left -= (size_t)count;
    }
    return status;
}

#else
/* Pull a cotangent back through the step that led to s, whose trail is given; s goes back in time, but for its state. */
static phi_status phi_back_step(phi_solver *s, phi_kept trail, phi_cotangent *bar)
{
    phi_status status = PHI_OK;
    phi_go_back(s);
#if PHI_SPLITTING
    status = phi_stage_adjoint(s->coef, trail, bar, bar->coef);
#elif PHI_GAUSS
    status = phi_stage_adjoint(s, trail, bar);
#else
    PHI_EACH_STAGE_BACK
        if (status == PHI_OK) status = phi_stage_adjoint(PHI_OF(s->coef, stage), PHI_OF(trail, stage), bar, PHI_OF(bar->coef, stage));
#endif
#if PHI_RENEWED
#if PHI_SPLITTING
    for (int k = 0; k < PHI_ROWS_OF_FLOWS; ++k)
        phi_early(s->coef + k * PHI_ROW, bar->coef + k * PHI_ROW, s->t + phi_moments[k] * s->h);
#else
    PHI_EACH_STAGE
        phi_early(PHI_OF(s->coef, stage), PHI_OF(bar->coef, stage), s->t + PHI_OF(phi_middles, stage) * s->h);
#endif
#endif
    return status;
}

/* Pull cotangents of rows back through a run that ended at s and left its trail. */
static phi_status phi_back(phi_solver *s, size_t steps, size_t stride, const double *rows_bar,
    phi_kept *trail, phi_cotangent *bar)
{
    phi_status status = PHI_OK;
    for (size_t done = steps; done > 0 && status == PHI_OK; --done) {
        phi_join(bar, rows_bar, done, steps, stride);
        status = phi_back_step(s, trail[done - 1], bar);
    }
    return status;
}

#endif
#if PHI_IMPLICIT
/* The trail of the last steps, from what the solver remembers of them. 0 if it does not remember all. */
static int phi_remembered(const phi_solver *s, size_t steps, phi_kept *trail)
{
    PHI_EACH_STAGE {
        const phi_history *history = &PHI_OF(s->history, stage);
#if PHI_RECURRENCES
        const size_t count = (size_t)history->count;
        if (count < steps) return 0;
        for (size_t k = 0; k < steps; ++k) memcpy(PHI_OF(trail[k], stage), history->past[count - steps + k], sizeof s->x);
#else
        if (steps > 1) return 0;
        memcpy(PHI_OF(trail[0], stage), history->difference[0], sizeof s->x);
#endif
    }
    return 1;
}

#endif
/* Make a few steps, and their trail. */
static phi_status phi_leave_few(phi_solver *s, size_t steps, phi_kept *trail)
{
    const phi_solver before = *s;
    phi_status status;
#if PHI_IMPLICIT
    status = phi_integrate(s, s->h, steps);
    if (status == PHI_OK && !phi_remembered(s, steps, trail)) { /* a step forgot what was before it */
        *s = before;
        for (size_t k = 0; k < steps && status == PHI_OK; ++k) {
            status = phi_step(s, s->h);
            if (status == PHI_OK && !phi_remembered(s, 1, trail + k)) status = PHI_NO_CONVERGENCE;
        }
    }
#elif PHI_SPLITTING
    status = phi_integrate_leaving(s, s->h, steps, trail[0]);
#else
    status = phi_integrate(s, s->h, steps);
#if PHI_GAUSS
    memcpy(trail[0], before.x, sizeof before.x);
    memcpy(trail[0] + PHI_DIM, s->history.moves, sizeof s->history.moves);
#elif PHI_COMPOSED
    double x[PHI_DIM], change[PHI_DIM];
    memcpy(x, before.x, sizeof x);
    for (int stage = 0; stage < PHI_STAGES; ++stage) {
        memcpy(trail[0][stage], x, sizeof x);
        phi_explicit(s->coef[stage], x, change);
        for (int i = 0; i < PHI_DIM; ++i) x[i] += change[i];
    }
#else
    memcpy(trail[0], before.x, sizeof before.x);
#endif
#endif
    if (status != PHI_OK) *s = before;
    return status;
}

/* How many steps are recorded at once: those that the solver remembers. */
#if PHI_RECURRENCES
#define PHI_AT_ONCE ((size_t)PHI_REMEMBERED)
#elif PHI_SPLITTING
#define PHI_AT_ONCE ((size_t)-1)
#else
#define PHI_AT_ONCE ((size_t)1)
#endif

/* Make steps, and their trail. Rows, where not NULL, are the states after each stride steps, and at the end. */
static phi_status phi_leave_trail(phi_solver *s, size_t steps, size_t stride, double *rows,
    phi_kept *trail)
{
    phi_status status = PHI_OK;
    for (size_t done = 0; done < steps && status == PHI_OK;) {
        const size_t until = steps - done < stride - done % stride ? steps - done : stride - done % stride;
        const size_t count = until < PHI_AT_ONCE ? until : PHI_AT_ONCE;
        status = phi_leave_few(s, count, trail + done);
        done += count;
        if (rows != NULL && count == until) {
            memcpy(rows, s->x, sizeof s->x);
            rows += PHI_DIM;
        }
    }
    return status;
}

/* Add the cotangents of parameters that follow from those of coefficients. */
static void phi_add_parameters(const phi_solver *s, const phi_cotangent *bar, phi_params *params_bar PHI_AND_DOUBLE(e_bar))
{
    double found[sizeof(phi_params) / sizeof(double) + 1];
#if PHI_PARAMETERS
    double sums[sizeof(phi_params) / sizeof(double)] = { 0.0 };
    if (params_bar != NULL) memcpy(sums, params_bar, sizeof *params_bar);
#else
    (void)params_bar;
#endif
#if PHI_MONITOR
    double level[1];
#endif
#if PHI_SPLITTING
    for (int k = 0; k < PHI_ROWS_OF_FLOWS; ++k) {
        const double *own = bar->coef + k * PHI_ROW;
#if PHI_KICKS
        const double kick[1] = { phi_multiples[k] * (s->h * s->h) };
        phi_prepare_adjoint(&s->params, phi_times[k] * s->h, kick, own, found);
#elif PHI_MONITOR
        phi_prepare_adjoint(&s->params, s->gauge, phi_times[k] * s->h, own, found, level);
#else
        phi_prepare_adjoint(&s->params, phi_times[k] * s->h, own, found);
#endif
#else
    PHI_EACH_STAGE {
        phi_prepare_adjoint(&s->params PHI_AND_GAUGE(s->gauge), PHI_FRACTION(s->h), PHI_OF(bar->coef, stage), found PHI_AND_LEVEL(level));
#endif
#if PHI_PARAMETERS
        for (size_t i = 0; i < sizeof sums / sizeof sums[0]; ++i) sums[i] += found[i];
#endif
#if PHI_MONITOR
        if (e_bar != NULL) *e_bar += level[0];
#endif
    }
#if PHI_PARAMETERS
    if (params_bar != NULL) memcpy(params_bar, sums, sizeof *params_bar);
#endif
}

#if PHI_MONITOR
void phi_level_bar(const phi_params *params, const double x0[PHI_DIM], double e_bar, double x0_bar[PHI_DIM],
    phi_params *params_bar)
{
    double slope[PHI_DIM], found[sizeof(phi_params) / sizeof(double) + 1];
    phi_level_adjoint(params != NULL ? params : &phi_default_params, x0, slope, found);
    for (int i = 0; i < PHI_DIM; ++i) x0_bar[i] -= e_bar * slope[i];
#if PHI_PARAMETERS
    double sums[sizeof(phi_params) / sizeof(double)];
    memcpy(sums, params_bar, sizeof sums);
    for (size_t i = 0; i < sizeof sums / sizeof sums[0]; ++i) sums[i] -= e_bar * found[i];
    memcpy(params_bar, sums, sizeof sums);
#else
    (void)params_bar;
#endif
}

phi_status phi_pullback(phi_solver *s, double h, size_t steps, size_t stride, double *rows, const double *rows_bar,
    double x0_bar[PHI_DIM], phi_params *params_bar, double *e_bar, double *trail)
#else
phi_status phi_pullback(phi_solver *s, double h, size_t steps, size_t stride, double *rows, const double *rows_bar,
    double x0_bar[PHI_DIM], phi_params *params_bar, double *trail)
#endif
{
    if (s == NULL || rows_bar == NULL || x0_bar == NULL || trail == NULL || stride == 0) return PHI_BAD_ARGUMENT;
    const phi_solver before = *s;
    phi_status status = phi_integrate(s, h, 0); /* makes all that depends on h */
    if (status != PHI_OK) return status;
    phi_kept *kept = (phi_kept *)trail;
    phi_cotangent bar;
    memset(&bar, 0, sizeof bar);
    status = phi_leave_trail(s, steps, stride, rows, kept);
    if (status == PHI_OK) {
        phi_solver at = *s;
#if PHI_PATH
        memcpy(bar.end, s->x, sizeof bar.end);
#endif
        status = phi_back(&at, steps, stride, rows_bar, kept, &bar);
    }
    for (int i = 0; i < PHI_DIM; ++i)
        if (!isfinite(bar.x[i]) && status == PHI_OK) status = PHI_NOT_FINITE;
    if (status != PHI_OK) {
        *s = before;
        return status;
    }
#if PHI_MONITOR
    phi_add_parameters(s, &bar, params_bar, e_bar);
#elif PHI_PARAMETERS
    phi_add_parameters(s, &bar, params_bar);
#else
    (void)params_bar;
#endif
    memcpy(x0_bar, bar.x, sizeof bar.x);
    return PHI_OK;
}

size_t phi_trail_size(void) { return PHI_TRAIL; }
#if PHI_EACH
size_t phi_trail_size_each(void) { return PHI_TRAIL_EACH; }
#endif

phi_status phi_step_adjoint(phi_solver *s, double h, const double x1_bar[PHI_DIM], double x0_bar[PHI_DIM],
    phi_params *params_bar)
{
    double trail[PHI_TRAIL];
#if PHI_MONITOR
    return phi_pullback(s, h, 1, 1, NULL, x1_bar, x0_bar, params_bar, NULL, trail);
#else
    return phi_pullback(s, h, 1, 1, NULL, x1_bar, x0_bar, params_bar, trail);
#endif
}
#endif
