#ifndef PHI_FILE_LATTICE_ADJOINT
#define PHI_FILE_LATTICE_ADJOINT
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "lattice_checkpoints.c"
#include "lattice_adjoint_stages.c"
#include "lattice_adjoint_flows.c"

/* ---- Reverse pass of runs ---- */
/* Add the partial sums of the cotangents of coefficients, over all row segments in order, to coef_bar, and clear them. */
static void phi_add_up(const phi_solver *s, phi_transpose *g, double coef_bar[PHI_SUMS])
{
    const size_t units = phi_units(s);
    for (size_t unit = 0; unit < units; ++unit)
        for (size_t k = 0; k < PHI_SUMS; ++k) {
            coef_bar[k] += g->sums[unit * PHI_SUMS + k];
            g->sums[unit * PHI_SUMS + k] = 0.0;
        }
}

#include "lattice_adjoint_renewed.c"

/* Add the cotangents of parameters to *params_bar. For parameters with one value, they follow from the cotangents of the
   coefficients. */
static void phi_add_parameters(const phi_solver *s, const phi_transpose *g, const double coef_bar[PHI_SUMS],
    phi_params_bar *params_bar)
{
#if PHI_NUMBERED
    for (int row = 0; row < PHI_ROWS_OF_FLOWS; ++row) {
        double parameter_bars[PHI_NUMBERS] = { 0.0 };
#if PHI_KICKS
        const double kick[1] = { phi_multiples[row] * (s->h * s->h) };
        phi_prepare_adjoint(&s->params, phi_times[row] * s->h, kick, coef_bar + row * PHI_ROW, parameter_bars);
#else
        phi_prepare_adjoint(&s->params, phi_times[row] * s->h, coef_bar + row * PHI_ROW, parameter_bars);
#endif
        phi_add_numbers(parameter_bars, params_bar);
    }
#if PHI_SERIES && PHI_GATHER
    phi_add_numbers(coef_bar + PHI_COEFFICIENTS, params_bar); /* contributions of sums over bonds or pairs, which depend on parameters directly */
#endif
#else
    (void)coef_bar;
#endif
    phi_add_arrays(s, g->bar, params_bar);
}

#if PHI_NEAR
/* Whether the cotangents of parameters are finite. If not, arguments were too large for the fast versions of functions. */
static int phi_parameters_hold(const phi_solver *s, const phi_transpose *g, const double coef_bar[PHI_SUMS])
{
    int hold = phi_finite(coef_bar, PHI_SUMS);
    for (size_t k = PHI_DIM; k < PHI_ARRAYS; ++k)
        PHI_EACH_ROW hold &= phi_finite(PHI_ROW_AT(g->bar[k]), (size_t)s->length);
#if PHI_BOND_PARAMETERS
    for (int k = PHI_ARRAYS; k < PHI_BARS; ++k) hold &= phi_finite(g->bar[k], (size_t)s->bonds[s->sites]);
#endif
    return hold;
}

#endif
/* Number of steps, out of the steps left, until the next checkpoint; at least g->longest. If there is no room for
   another checkpoint, it is the number of all steps but the last g->longest. */
static size_t phi_onward(const phi_transpose *g, size_t left)
{
    const size_t free = g->most - g->count, parts = free > 1 ? free / 2 + 1 : 2;
    const size_t steps_of_segment = free == 0 ? left - g->longest : left <= g->longest * (free + 1) ? g->longest : (left + parts - 1) / parts;
#if PHI_RECOMPUTED
    return phi_legs(steps_of_segment, g->leg) * g->leg;
#else
    return steps_of_segment;
#endif
}

/* Pull the cotangents back through the steps from number `done` to number `until`, whose tape has been written; s holds the
   state after them. */
static phi_status phi_segment_back(phi_solver *s, phi_transpose *g, size_t done, size_t until, size_t stride, size_t steps,
    const double *rows_bar, double coef_bar[PHI_SUMS])
{
    phi_status status = PHI_OK;
#if PHI_RECOMPUTED
    for (size_t k = until, next; k > done && status == PHI_OK; k = next) {
        const size_t row = (k - 1) / stride, leg = (k - 1 - done) / g->leg, most = PHI_UNASKED / s->sites + 1;
        if (k == steps || k % stride == 0) phi_row_back(s, g, g->first_step + k, rows_bar + row * PHI_DIM * s->sites);
#if PHI_RENEWED
        next = k - 1;
#else
        next = row * stride > done + leg * g->leg ? row * stride : done + leg * g->leg; /* back to the last output row, or to the start of the leg */
        next = k - next > most ? k - most : next;
#endif
        if (g->anew) {
            phi_step_back_anew(s, g, g->first_step + next, leg);
        } else {
            PHI_PARALLEL
            phi_steps_back(s, g, g->first_step + next, k - next);
        }
        if (next == done + leg * g->leg) status = phi_leave_leg(s, g, leg);
#if PHI_RENEWED
        phi_add_up_step(s, g, g->first_step + next, coef_bar);
        (void)most;
#else
        (void)coef_bar;
#endif
        if (status == PHI_OK && phi_is_stopped(s, g, k - next)) status = PHI_STOPPED;
    }
#else
#if PHI_SERIES
    phi_forget(s);
#else
    memcpy(g->x, s->x, sizeof g->x);
#endif
    for (size_t k = until; k > done && status == PHI_OK; --k) {
        const size_t row = (k - 1) / stride, before = g->first_step + k - 1;
        double *tape = g->tape + (k - 1 - done) * g->of_step;
        if (k == steps || k % stride == 0) phi_row_back(s, g, before + 1, rows_bar + row * PHI_DIM * s->sites);
#if PHI_SERIES
        status = phi_step_back(s, g, before, tape);
#else
        phi_step_back(s, g, before, k > 1, tape);
#endif
#if PHI_RENEWED
        phi_add_up_step(s, g, before, coef_bar);
#else
        (void)coef_bar;
#endif
        if (status == PHI_OK && phi_is_stopped(s, g, 1)) status = PHI_STOPPED;
    }
#endif
    return status;
}

/* Pull the cotangents back through a run, segment by segment, the last one first. */
static phi_status phi_run_back(phi_solver *s, phi_transpose *g, size_t steps, size_t stride, double *rows,
    const double *rows_bar, double coef_bar[PHI_SUMS])
{
    phi_status status = PHI_OK;
    for (size_t end = steps, done; end > 0 && status == PHI_OK; end = done) {
        double *const forward_rows = end == steps ? rows : NULL;
        done = phi_return(s, g);
        while (end - done > g->longest && status == PHI_OK) {
            const int free = g->count < g->most;
            const size_t next = done + phi_onward(g, end - done);
            status = phi_walk(s, g, done, next, stride, steps, forward_rows, 0);
            done = next;
            if (free && status == PHI_OK) phi_mark(s, g, done);
        }
        if (status == PHI_OK) status = phi_walk(s, g, done, end, stride, steps, forward_rows, 1);
        if (status != PHI_OK) break;
        if (end == steps) {
            phi_copy(g->end, s->x, s);
#if !PHI_SERIES
            g->last_full_range = s->full_range;
#endif
        }
        status = phi_segment_back(s, g, done, end, stride, steps, rows_bar, coef_bar);
        if (status == PHI_OK && !phi_all_hold(s, g->bar)) status = PHI_NOT_FINITE;
#if PHI_RECOMPUTED
        g->failed = status == PHI_NOT_FINITE && !g->full_range && !g->lost;
#else
        g->failed = status != PHI_OK && status != PHI_STOPPED && !g->full_range;
#endif
        if (g->count > 1 && done == g->marks[2 * (g->count - 1)]) --g->count;
    }
#if !PHI_RENEWED
    phi_add_up(s, g, coef_bar);
#endif
#if PHI_NEAR
    if (status == PHI_OK && !g->full_range && !phi_parameters_hold(s, g, coef_bar)) {
        g->failed = 1;
        status = PHI_NOT_FINITE;
    }
#endif
    return status;
}

/* Make a run from the present state of s and its reverse pass; the cotangents of coefficients start from 0. */
static phi_status phi_attempt(phi_solver *s, phi_transpose *g, size_t steps, size_t stride, double *rows,
    const double *rows_bar, double coef_bar[PHI_SUMS], void *trail, size_t size)
{
    phi_place_transpose(s, g, steps, trail, size);
    memset(coef_bar, 0, PHI_SUMS * sizeof *coef_bar);
    g->first_step = s->steps;
#if PHI_SERIES
    s->shares = g->sums;
    s->handed = g->handed;
    s->wide = g->full_range;
#else
    s->open = 0;
#endif
    phi_mark(s, g, 0);
    return phi_run_back(s, g, steps, stride, rows, rows_bar, coef_bar);
}

#if PHI_NEAR || PHI_RECOMPUTED
/* Whether the reverse pass must be repeated: with functions for arguments of any size, or with the state stored after
   fewer steps. Restores the initial state in this case. */
static int phi_begins_again(phi_solver *s, phi_transpose *g)
{
#if PHI_RECOMPUTED
    if (!g->failed && !g->lost) return 0;
    if (!g->lost) g->full_range = 1;
    else if (g->leg > 1) g->leg = 1;
    else g->anew = 1;
    g->lost = 0;
#else
    if (!g->failed) return 0;
    g->full_range = 1;
#endif
    g->failed = 0;
    g->count = 1;
    phi_return(s, g);
    g->count = 0;
    return 1;
}

#endif
phi_status phi_pullback(phi_solver *s, double h, size_t steps, size_t stride, double *rows, const double *rows_bar,
    double *x0_bar, phi_params_bar *params_bar, void *trail, size_t size)
{
    if (s == NULL || (rows_bar == NULL && steps > 0) || x0_bar == NULL || trail == NULL || stride == 0)
        return PHI_BAD_ARGUMENT;
    if (size < phi_trail_size(s, 1)) return PHI_BAD_ARGUMENT;
    phi_status status = phi_set_step(s, h);
    if (status != PHI_OK) return status;
    phi_transpose g;
    double coef_bar[PHI_SUMS];
    memset(&g, 0, sizeof g);
#if PHI_RECOMPUTED
    g.leg = PHI_STRETCH;
#if !PHI_NEAR
    g.full_range = 1; /* no function has a fast version for small arguments */
#endif
#endif
    status = phi_attempt(s, &g, steps, stride, rows, rows_bar, coef_bar, trail, size);
#if PHI_NEAR || PHI_RECOMPUTED
    while (phi_begins_again(s, &g)) status = phi_attempt(s, &g, steps, stride, rows, rows_bar, coef_bar, trail, size);
#endif
    status = phi_settle(s, &g, steps, status);
    if (status != PHI_OK) return status;
    phi_take(s, g.bar, x0_bar);
    if (params_bar != NULL) phi_add_parameters(s, &g, coef_bar, params_bar);
    return PHI_OK;
}

void phi_ask(phi_solver *s, int (*stop)(void)) { s->stop = stop; }

phi_status phi_step_adjoint(phi_solver *s, double h, const double *x1_bar, double *x0_bar, phi_params_bar *params_bar,
    void *trail)
{
    if (s == NULL) return PHI_BAD_ARGUMENT;
    return phi_pullback(s, h, 1, 1, NULL, x1_bar, x0_bar, params_bar, trail, phi_trail_size(s, 1));
}
#endif
