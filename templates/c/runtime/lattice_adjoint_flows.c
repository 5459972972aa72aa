#ifndef PHI_FILE_LATTICE_ADJOINT_FLOWS
#define PHI_FILE_LATTICE_ADJOINT_FLOWS
#include <string.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "lattice_checkpoints.c"

/* ---- Reverse pass of flows ---- */
#if !PHI_TAKES
/* Index of sweep `number` in a flow; -1 if the flow has fewer. */
static int phi_sweep_of(const phi_solver *s, int flow, int number)
{
    const int part = phi_flow_parts[flow];
#if PHI_BY_COLOUR
#if PHI_TIMED
    const int last = s->flows;
#else
    const int last = s->flows - 1;
#endif
    const int place = part == 0 ? 0 : part == 2 ? last : part == 1 ? 1 + number : last - 1 - number;
    return (part == 0 || part == 2) && number > 0 ? -1 : part % 2 == 1 && (place < 1 || place >= last) ? -1 : place;
#else
    (void)s;
    return number == 0 ? part : -1;
#endif
}

/* The part of H, counted from 0, to which a sweep belongs. */
static int phi_part_of(const phi_solver *s, int sweep)
{
#if PHI_BY_COLOUR
    int part = 0;
    for (int colours; sweep >= (colours = phi_by_colour[part] ? s->colour_count : 1); ++part) sweep -= colours;
    return part;
#else
    (void)s;
    return sweep - 1;
#endif
}

#endif
#include "lattice_recomputed.c"
#include "lattice_tape.c"

/* Add the cotangent of an output row: of the state after a number of steps. The state of the reverse pass is the state
   before the last flow of these steps, so the cotangent is first pulled back through this flow. */
static void phi_row_back(const phi_solver *s, phi_transpose *g, size_t steps, const double *row_bar)
{
    for (size_t f = 0; f < PHI_DIM; ++f) phi_put(s, g->row_bar[f], row_bar + f * s->sites);
    PHI_PARALLEL
    {
#if PHI_RECOMPUTED
        if (PHI_FLOWS > 1) {
            phi_flow last;
            size_t count = 0;
            phi_set_flow(s, steps - 1, PHI_FLOWS - 1, &last);
            phi_sweep_part(s, last.part, last.coef PHI_AND_FULL_RANGE(g->full_range)); /* applied here, since the reverse pass inverts it */
#if PHI_TAKES
            phi_hand_nothing(s, g, phi_number_of(steps, 0) + 1);
            phi_flow_back(s, g, steps - 1, PHI_FLOWS - 1, g->row_bar, &last, &count, 1);
            phi_hand_last(s, g, phi_number_of(steps, 0), g->row_bar);
#else
            phi_flow_back(s, g, steps - 1, PHI_FLOWS - 1, g->row_bar, &last, &count, 1);
#endif
        }
#else
        double *x[PHI_ARRAYS];
        memcpy(x, g->x, sizeof x);
        if (PHI_FLOWS > 1) phi_flow_back(s, g, steps - 1, PHI_FLOWS - 1, NULL, x, g->row_bar);
#endif
        size_t first, end = phi_share(phi_units(s), &first);
        for (size_t unit = first; unit < end; ++unit) {
            const phi_row row = phi_piece_of(s, unit);
            for (int f = 0; f < PHI_DIM; ++f) {
                const double *restrict from = PHI_HERE(g->row_bar[f]);
                double *restrict to = PHI_HERE(g->bar[f]);
                for (ptrdiff_t i = row.from; i < row.to; ++i) to[i] += from[i];
#if PHI_RECOMPUTED
                PHI_COPY_ENDS(to, s->length, row.from, row.to)
#endif
            }
        }
    }
}

/* Make the steps from number `done` to number `until` of a run. `rows`, if not NULL, receives the states after stride,
   2 stride, ... steps and at the end of the run. keeping = 1 writes the tape. */
static phi_status phi_walk(phi_solver *s, phi_transpose *g, size_t done, size_t until, size_t stride, size_t steps,
    double *rows, int keeping)
{
    phi_status status = PHI_OK;
#if PHI_RECOMPUTED
    const size_t begin = done;
#else
    s->tape = keeping ? g->tape : NULL;
#endif
    while (done < until && status == PHI_OK) {
        const size_t row = done / stride + 1, left = until - done, ahead = row * stride - done;
        const size_t most = PHI_UNASKED / s->sites + 1, steps_to_row = rows == NULL || left < ahead ? left : ahead;
#if PHI_RECOMPUTED
        const size_t leg = keeping ? g->leg - (done - begin) % g->leg : steps_to_row, less = steps_to_row < leg ? steps_to_row : leg;
        const size_t now = less < most ? less : most;
        if (keeping && (done - begin) % g->leg == 0) {
            double *fields[PHI_DIM];
            phi_fields_of_leg(g, (done - begin) / g->leg, fields);
            phi_copy(fields, s->x, s);
        }
#else
        const size_t now = steps_to_row < most ? steps_to_row : most;
#endif
        status = phi_march(s, now);
        done += now;
        if (status == PHI_OK && phi_is_stopped(s, g, now)) status = PHI_STOPPED;
        if (status != PHI_OK || rows == NULL || (done != steps && done % stride != 0)) continue;
#if !PHI_RECOMPUTED
        double *const tape = s->tape;
        s->tape = NULL;
#endif
        if (s->open && !PHI_TRY_FLOWS) status = PHI_NOT_FINITE;
        phi_take(s, s->x, rows + (row - 1) * PHI_DIM * s->sites);
        phi_copy(s->x, s->before, s);
#if !PHI_RECOMPUTED
        s->tape = tape;
#endif
    }
#if !PHI_RECOMPUTED
    s->tape = NULL;
#endif
    return status;
}

/* Set the solver to the state after all steps or, on failure, to the state before them; returns the status. */
static phi_status phi_settle(phi_solver *s, phi_transpose *g, size_t steps, phi_status status)
{
    if (status != PHI_OK || steps == 0) {
        g->count = 1;
        phi_return(s, g);
        return status;
    }
    phi_copy(s->x, g->end, s);
    phi_copy(s->before, g->end, s);
    s->full_range = g->last_full_range;
    s->steps = g->first_step + steps;
    s->open = PHI_FLOWS > 1;
    if (s->open && !PHI_TRY_FLOWS) status = PHI_NOT_FINITE;
    s->t = s->t_before_h + (double)(s->steps - s->steps_before_h) * s->h;
#if PHI_TIMED
    s->now = s->t;
#endif
    return status;
}
#endif
