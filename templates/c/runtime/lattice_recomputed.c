#ifndef PHI_FILE_LATTICE_RECOMPUTED
#define PHI_FILE_LATTICE_RECOMPUTED
#include <math.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "lattice_checkpoints.c"

/* ---- Reverse pass with states recomputed by the inverse flows ---- */
#include "lattice_recomputed_alternating.c"
#include "lattice_recomputed_sites.c"
static void phi_reverse_flow(const phi_solver *s, const phi_flow *flow, size_t first, size_t end)
{
    const phi_transpose *g = flow->g;
#if PHI_TAKES
    phi_back_rows(s, phi_ways[flow->row], flow->coef PHI_AND_FULL_RANGE(g->full_range), s->x, flow->bar, phi_handed_by(g, (size_t)flow->go - 1),
        phi_handed_by(g, (size_t)flow->go), g->sums + flow->row * PHI_ROW, first, end);
#else
#if PHI_HANDS
    if (flow->go > 1) {
#if PHI_GATHER
        phi_hand_rows(s, flow->part, flow->coef PHI_AND_FULL_RANGE(g->full_range), s->x, flow->bar, g->handed, g->sums + flow->row * PHI_ROW, first, end);
#else
        phi_hand_rows(s, flow->part, s->x, flow->bar, g->handed, first, end);
#endif
        return;
    }
#endif
    phi_back_rows(s, flow->part, flow->coef PHI_AND_FULL_RANGE(g->full_range), s->x, flow->bar, g->handed, g->sums + flow->row * PHI_ROW, first, end);
#endif
}

/* Pull cotangents back through some flows, in the order of the array; called by all threads together. */
static void phi_reverse_flows(const phi_solver *s, const phi_flow *flows, size_t count)
{
#if PHI_WAVES
    if (count > 1) {
        phi_make_wave(s, flows, count);
        return;
    }
#endif
    size_t first, end = phi_share(phi_units(s), &first);
    for (size_t k = 0; k < count; ++k) {
        phi_reverse_flow(s, flows + k, first, end);
        phi_wait();
    }
}

#if !PHI_WAVES
enum { PHI_DEEPEST = 1 }; /* number of flows that are processed together */
#endif

/* Flow `number` of a step must be pulled back for the cotangents bar: append it to the queue, which has *count flows.
   The queue is processed when it holds `depth` flows. */
static void phi_flow_back(const phi_solver *s, const phi_transpose *g, size_t step, int number, double *const *bar,
    phi_flow *flows, size_t *count, size_t depth)
{
#if PHI_TAKES
    phi_flow *next = flows + *count;
    phi_set_flow(s, step, number, next);
    next->go = 1 + (int)(phi_number_of(step, number) % 2);
    next->row = number;
    next->g = g;
    next->bar = bar;
    if (++*count < depth) return;
    phi_reverse_flows(s, flows, *count);
    *count = 0;
#else
    int k = 0;
    while (phi_sweep_of(s, number, k) >= 0) ++k;
    while (k-- > 0)
        for (int go = 1, last = 1; go <= last; ++go) {
            phi_flow *next = flows + *count;
            phi_set_flow(s, step, number, next);
            next->part = phi_sweep_of(s, number, k);
            next->go = go;
            next->row = number;
            next->g = g;
            next->bar = bar;
            last = 1 + phi_hands[phi_part_of(s, next->part)];
            if (++*count < depth) continue;
            phi_reverse_flows(s, flows, *count);
            *count = 0;
        }
#endif
}

/* Pull cotangents back through `steps` steps that follow step number `before`, with merged flows. The inverse flows
   recompute the states on the way: s->x becomes the state before these steps. */
static void phi_steps_back(const phi_solver *s, const phi_transpose *g, size_t before, size_t steps)
{
#if PHI_WAVES
    const size_t depth = phi_depth(s);
#else
    const size_t depth = 1;
#endif
    phi_flow flows[PHI_DEEPEST];
    size_t count = 0;
#if PHI_TAKES
    phi_hand_nothing(s, g, phi_number_of(before + steps, 0));
#endif
    for (size_t left = steps * PHI_OWN_FLOWS; left-- > 0;) {
        const size_t step = before + left / PHI_OWN_FLOWS;
        const int number = phi_joined((int)(left % PHI_OWN_FLOWS), step > g->first_step);
        phi_flow_back(s, g, step, number, g->bar, flows, &count, depth);
    }
    phi_reverse_flows(s, flows, count);
#if PHI_TAKES
    phi_hand_last(s, g, phi_number_of(before, 0), g->bar);
#endif
}

/* Set fields to the arrays on the tape for the state at the start of a leg. */
static void phi_fields_of_leg(const phi_transpose *g, size_t leg, double *fields[PHI_DIM])
{
    for (size_t f = 0; f < PHI_DIM; ++f) fields[f] = PHI_FIRST_SITE(g->tape + (leg * PHI_DIM + f) * g->block);
}

/* Pull cotangents back through the step that is leg number `leg`. The state before each flow is recomputed from the start of
   the step, where inverse flows would lose too many digits. */
static void phi_step_back_anew(phi_solver *s, const phi_transpose *g, size_t before, size_t leg)
{
    double *began[PHI_DIM];
    phi_fields_of_leg(g, leg, began);
    for (int last = PHI_OWN_FLOWS; last-- > 0;) {
        phi_copy(s->x, began, s);
        PHI_PARALLEL
        {
            phi_flow flow;
            size_t count = 0;
            for (int number = 0; number <= last; ++number) {
                phi_set_flow(s, before, phi_joined(number, before > g->first_step), &flow);
                phi_sweep_part(s, flow.part, flow.coef PHI_AND_FULL_RANGE(g->full_range));
            }
#if PHI_TAKES
            if (last == PHI_OWN_FLOWS - 1) phi_hand_nothing(s, g, phi_number_of(before + 1, 0));
#endif
            phi_flow_back(s, g, before, phi_joined(last, before > g->first_step), g->bar, &flow, &count, 1);
#if PHI_TAKES
            if (last == 0) phi_hand_last(s, g, phi_number_of(before, 0), g->bar);
#endif
        }
    }
}

/* Largest magnitude in a field. Eight partial results let the loops vectorise. */
static double phi_largest_of(const phi_solver *s, const double *field)
{
    double lanes[8] = { 0.0 };
    const ptrdiff_t vectors_end = s->length - s->length % 8;
    PHI_EACH_ROW {
        const double *row = PHI_ROW_AT(field);
        for (ptrdiff_t i = 0; i < vectors_end; i += 8)
            for (int l = 0; l < 8; ++l) lanes[l] = fabs(row[i + l]) > lanes[l] ? fabs(row[i + l]) : lanes[l];
        for (ptrdiff_t i = vectors_end; i < s->length; ++i) lanes[0] = fabs(row[i]) > lanes[0] ? fabs(row[i]) : lanes[0];
    }
    for (int l = 1; l < 8; ++l) lanes[0] = lanes[l] > lanes[0] ? lanes[l] : lanes[0];
    return lanes[0];
}

/* Whether two fields differ by no more than `most` at each site. */
static int phi_differ_by(const phi_solver *s, const double *one, const double *other, double most)
{
    int agree = 1;
    PHI_EACH_ROW {
        const double *first = PHI_ROW_AT(one), *second = PHI_ROW_AT(other);
        for (ptrdiff_t i = 0; i < s->length; ++i) agree &= fabs(first[i] - second[i]) <= most;
    }
    return agree;
}

/* After all steps of a leg have been recomputed, return to the state that is stored at its start. Fails if the
   recomputed state differs too much from the stored one. */
static phi_status phi_leave_leg(const phi_solver *s, phi_transpose *g, size_t leg)
{
    double *began[PHI_DIM], largest = 0.0;
    phi_fields_of_leg(g, leg, began);
    for (size_t f = 0; f < PHI_DIM; ++f) {
        const double size = phi_largest_of(s, began[f]);
        largest = size > largest ? size : largest;
    }
    if (!phi_all_hold(s, s->x)) {
        g->lost = g->full_range && !g->anew;
        return PHI_NOT_FINITE;
    }
    for (size_t f = 0; f < PHI_DIM; ++f)
        if (!g->anew && !phi_differ_by(s, s->x[f], began[f], PHI_UNLIKE * largest)) g->lost = 1;
    phi_copy(s->x, began, s);
    return g->lost ? PHI_NOT_FINITE : PHI_OK;
}
#endif
