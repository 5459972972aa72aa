#ifndef PHI_FILE_LATTICE_FLOWS
#define PHI_FILE_LATTICE_FLOWS
#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "sweeps.h"

/* ---- The flows ---- */
enum { PHI_STRETCH = 32 }; /* steps between checks for finite values */
#if PHI_NEAR
enum { PHI_FULL_RANGE_STEPS = 64 }; /* number of steps with functions for arguments of any size, after a step that needed them */
#endif

#if PHI_SHARED
#if PHI_BY_COLOUR
/* Apply the flow of a part of H, or the flow of its terms at sites of one colour; called by all threads together. */
static void phi_sweep_colour(const phi_solver *s, int part, const double *coef PHI_AND_INT_FULL_RANGE)
#else
/* Apply the flow of one part of H; called by all threads together. */
static void phi_sweep_part(const phi_solver *s, int part, const double *coef PHI_AND_INT_FULL_RANGE)
#endif
{
    size_t first, end = phi_share(phi_units(s), &first);
#if PHI_TANGENT && !PHI_MONITOR
    for (size_t k = 0; k < s->vectors; ++k) { /* threads need not wait: the fields that a flow changes are read at the same site only */
        double *v[PHI_DIM];
        phi_vector(s, k, v);
        if (part == PHI_REMAINDER) phi_gather_varied_pulls(s, coef, v, first, end);
        phi_tangent_rows(s, part, coef, v, first, end);
    }
#endif
    if (part == PHI_REMAINDER) phi_gather_pulls(s, coef, first, end);
    phi_sweep_rows(s, part, coef PHI_AND_FULL_RANGE(full_range), first, end);
    phi_wait();
}

#endif
#if PHI_BY_COLOUR
/* Apply flows of a stage. kind: 0 the first flow, 1 the inner ones, 2 the last, 3 the inner in reverse. */
static void phi_sweep_part(const phi_solver *s, int kind, const double *coef PHI_AND_INT_FULL_RANGE)
{
#if PHI_TIMED
    const int last = s->flows; /* the last flow advances the time */
#else
    const int last = s->flows - 1;
#endif
    if (kind % 2 == 0) phi_sweep_colour(s, kind == 0 ? 0 : last, coef PHI_AND_FULL_RANGE(full_range));
    for (int flow = 1; kind % 2 == 1 && flow < last; ++flow)
        phi_sweep_colour(s, kind == 1 ? flow : last - flow, coef PHI_AND_FULL_RANGE(full_range));
}

#endif
#include "lattice_flow_records.c"
#include "lattice_plain_flows.c"
#include "lattice_monitored_flows.c"

#if PHI_RECOMPUTED
static void phi_reverse_flow(const phi_solver *s, const phi_flow *flow, size_t first, size_t end);

#endif
#include "lattice_waves.c"

#if PHI_NOISE && PHI_SHARED
/* Draw the increments of the noise in a part of a step, at all sites; called by all threads together. */
static void phi_draw(const phi_solver *s, size_t steps, int part)
{
    size_t first, end = phi_share(phi_units(s), &first);
    phi_draw_pieces(s, steps, part, first, end);
    phi_wait();
}

#endif
#if PHI_NOISE
/* Make some steps, each by flows of the noise, of H, and again of the noise in reverse order. */
#elif PHI_CORRECTED
/* Make some steps. Before the first steps of a run, apply the flows of the corrector; for 0 steps, apply only the flows of
   the corrector at the end of a run. */
#else
/* Make steps except the very last flow, which the next step includes. For 0 steps, make only this flow. */
#endif
#if PHI_SHARED
static void phi_shared_steps(const phi_solver *s, size_t steps)
#else
static void phi_steps(const phi_solver *s, size_t steps)
#endif
{
#if PHI_NOISE
    for (size_t step = s->steps; step < s->steps + steps; ++step)
        for (int flow = 0; flow < PHI_FLOWS; ++flow) {
            if (flow == 0 || flow == PHI_FLOWS - (int)PHI_SOURCES) phi_draw(s, step, flow > 0);
#if PHI_RENEWED
            phi_apply_flow(s, step, flow);
#else
            phi_sweep_part(s, phi_flow_parts[flow], s->coef + flow * PHI_ROW PHI_AND_FULL_RANGE(s->full_range > 0));
#endif
        }
#elif PHI_CORRECTED
    const int before = PHI_FLOWS + PHI_FLOWS_BEFORE;
    for (int flow = before; steps == 0 && flow < PHI_ROWS_OF_FLOWS; ++flow) phi_apply_flow(s, s->steps, flow);
    for (int flow = PHI_FLOWS; steps > 0 && !s->open && flow < before; ++flow) phi_apply_flow(s, s->steps, flow);
    for (size_t step = s->steps; step < s->steps + steps; ++step)
        for (int flow = 0; flow < PHI_FLOWS; ++flow) phi_apply_flow(s, step, flow);
#else
    if (steps == 0) phi_apply_flow(s, s->steps - 1, PHI_FLOWS - 1);
#if PHI_WAVES
    phi_make_waves(s, steps);
#else
    for (size_t step = s->steps; step < s->steps + steps; ++step) {
        phi_apply_flow(s, step, PHI_FLOWS > 1 && (step > s->steps || s->open) ? PHI_FLOWS : 0);
        for (int flow = 1; flow < PHI_FLOWS - 1; ++flow) phi_apply_flow(s, step, flow);
    }
#endif
#endif
}

#if PHI_SHARED
static void phi_steps(const phi_solver *s, size_t steps)
{
    PHI_PARALLEL
    phi_shared_steps(s, steps);
}

#endif
#if PHI_ADJOINT && !PHI_RECOMPUTED
static size_t phi_step_tape_size(const phi_solver *s);
static void phi_make_steps_with_tape(const phi_solver *s, size_t steps);

#endif
/* Make some steps from the state in s->before. If values are not finite, restore this state and return 0. */
static int phi_try(phi_solver *s, size_t steps)
{
#if PHI_ADJOINT && !PHI_RECOMPUTED
    if (s->tape != NULL) phi_make_steps_with_tape(s, steps);
    else phi_steps(s, steps);
#else
    phi_steps(s, steps);
#endif
    if (phi_all_hold(s, s->x)) return 1;
    phi_copy(s->x, s->before, s);
    return 0;
}

/* Apply the last flow of a step, if needed with functions for arguments of any size; returns whether values are finite. */
static int phi_close(phi_solver *s)
{
    if (phi_try(s, 0)) return 1;
    const size_t full_range = s->full_range;
    s->full_range = 1;
    const int done = phi_try(s, 0);
    s->full_range = full_range;
    return done;
}

#if PHI_NOISE
/* Make steps from the state in s->before, which is also in s->x. Values are checked after several steps; if they are
   not finite, these steps are repeated one by one. */
#else
/* Make steps from the state in s->before, which is also in s->x. The last flow of the last step is not made. Values are
   checked after several steps; if they are not finite, these steps are repeated one by one. */
#endif
static phi_status phi_march(phi_solver *s, size_t steps)
{
    const size_t end = s->steps + steps;
    for (size_t stretch = PHI_STRETCH; s->steps < end;) {
        size_t now = end - s->steps < stretch ? end - s->steps : stretch;
#if PHI_NEAR
        if (s->full_range > 0 && s->full_range < now) now = s->full_range;
#endif
        if (!phi_try(s, now)) {
#if PHI_NEAR
            if (now == 1 && s->full_range > 0) return PHI_NOT_FINITE;
            if (now == 1) s->full_range = PHI_FULL_RANGE_STEPS; /* the fast functions give NaN if an argument is too large */
            stretch = now > 1 ? 1 : PHI_STRETCH;
#else
            if (now == 1) return PHI_NOT_FINITE;
            stretch = 1;
#endif
            continue;
        }
        phi_copy(s->before, s->x, s);
        s->steps += now;
#if PHI_ADJOINT && !PHI_RECOMPUTED
        if (s->tape != NULL) s->tape += now * phi_step_tape_size(s);
#endif
#if !PHI_NOISE
        s->open = PHI_FLOWS > 1;
#endif
#if PHI_NEAR
        s->full_range -= s->full_range > 0 ? now : 0;
#endif
    }
    return PHI_OK;
}

phi_status phi_integrate(phi_solver *s, double h, size_t steps)
{
    phi_status status = phi_set_step(s, h);
    if (status != PHI_OK || steps == 0) return status;
#if PHI_NOISE
    phi_copy(s->before, s->x, s);
#else
    if (!s->open) phi_to_relative(s, s->x);
    if (!s->open) phi_clear_other_carry(s);
    phi_copy(s->open ? s->x : s->before, s->open ? s->before : s->x, s); /* if s->open, take the last flow out of x: this flow is merged with the first flow of the next step */
#endif
    status = phi_march(s, steps);
#if !PHI_NOISE
    if (s->open && !PHI_TRY_FLOWS) { /* makes the last flow; s->before stays without it */
        status = PHI_NOT_FINITE;
        s->open = 0;
        --s->steps;
    }
#endif
    phi_to_cartesian(s, s->x);
    PHI_SET_TIME(s) PHI_TIME_AFTER(s, s->steps);
    return status;
}
#endif
