#ifndef PHI_FILE_LATTICE_ADJOINT_FLOWS
#define PHI_FILE_LATTICE_ADJOINT_FLOWS
#include <math.h>
#include <string.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "lattice_trail.c"

/* ---- The transpose of flows ---- */
#if !PHI_UNDONE
/* The sweep of that number in a flow; -1 if there are no more. */
static int phi_sweep_of(const phi_solver *s, int flow, int number)
{
    const int part = phi_flow_parts[flow];
#if PHI_BY_COLOUR
#if PHI_TIMED
    const int last = s->flows;
#else
    const int last = s->flows - 1;
#endif
    const int found = part == 0 ? 0 : part == 2 ? last : part == 1 ? 1 + number : last - 1 - number;
    return (part == 0 || part == 2) && number > 0 ? -1 : part % 2 == 1 && (found < 1 || found >= last) ? -1 : found;
#else
    (void)s;
    return number == 0 ? part : -1;
#endif
}

/* The part of H that a sweep belongs to, from 0 on. */
static int phi_part_of(const phi_solver *s, int sweep)
{
#if PHI_BY_COLOUR
    int part = 0;
    for (int own; sweep >= (own = phi_by_colour[part] ? s->colour_count : 1); ++part) sweep -= own;
    return part;
#else
    (void)s;
    return sweep - 1;
#endif
}

#endif
/* The sweeps that steps consist of where they are joined: without the last flow, unless that is all. */
#define PHI_OWN_FLOWS (PHI_FLOWS > 1 ? PHI_FLOWS - 1 : 1)

#if !PHI_UNDONE
/* The numbers that a step keeps. */
static size_t phi_numbers_kept(const phi_solver *s)
{
    size_t fields = 0;
    for (int flow = 0; flow < PHI_OWN_FLOWS; ++flow)
        for (int k = 0, sweep; (sweep = phi_sweep_of(s, flow, k)) >= 0; ++k)
            for (int f = 0; f < PHI_DIM; ++f) fields += phi_keeps[phi_part_of(s, sweep)][f];
    return (fields > 0 ? fields : 1) * phi_block(s->rows, s->width);
}

/* Keep the fields that a sweep will change, and that anything reads on the way back; returns where the next ones are kept. */
static double *phi_keep(const phi_solver *s, int sweep, double *to)
{
    size_t first, end = phi_share(phi_units(s), &first);
    for (int f = 0; f < PHI_DIM; ++f) {
        if (!phi_keeps[phi_part_of(s, sweep)][f]) continue;
        phi_keep_units(s, PHI_MEMORY_OF(s->x[f]), to, first, end);
        to += phi_block(s->rows, s->width);
    }
    return to;
}

/* The same as phi_steps, but for none; what flows change is kept in s->kept. */
static void phi_keep_steps(const phi_solver *s, size_t steps)
{
    const size_t of_step = phi_numbers_kept(s);
    PHI_PARALLEL
    for (size_t step = 0; step < steps; ++step) {
        double *kept = s->kept + step * of_step;
        for (int number = 0; number < PHI_OWN_FLOWS; ++number) {
            const int own = PHI_FLOWS > 1 && number == 0 && (step > 0 || s->open) ? PHI_FLOWS : number;
            phi_flow flow;
            phi_find_flow(s, s->steps + step, own, &flow);
            for (int k = 0, sweep; (sweep = phi_sweep_of(s, own, k)) >= 0; ++k) {
                kept = phi_keep(s, sweep, kept);
#if PHI_BY_COLOUR
                phi_sweep_colour(s, sweep, flow.coef PHI_AND_FAR(s->far > 0));
#else
                phi_sweep_part(s, sweep, flow.coef PHI_AND_FAR(s->far > 0));
#endif
            }
        }
    }
}

#endif
#if !PHI_UNDONE
/* Pull cotangents back through one sweep, x being the fields before it. */
static void phi_sweep_back(const phi_solver *s, const phi_transpose *g, int sweep, const double *coef, int row,
    double *const *x, double *const *bar)
{
    size_t first, end = phi_share(phi_units(s), &first);
    phi_back_rows(s, sweep, coef PHI_AND_FAR(g->far), x, bar, g->handed, g->sums + row * PHI_ROW, first, end);
#if PHI_HANDS
    if (!phi_hands[phi_part_of(s, sweep)]) return;
    phi_wait();
#if PHI_GATHER
    phi_hand_rows(s, sweep, coef, x, bar, g->handed, g->sums + row * PHI_ROW, first, end);
#else
    phi_hand_rows(s, sweep, x, bar, g->handed, first, end);
#endif
    phi_wait();
#endif
}

#endif
#if PHI_UNDONE
/* Pull cotangents back through a flow, and undo it, or hand what that has found, at pieces of rows. */
static void phi_go_back(const phi_solver *s, const phi_flow *flow, size_t first, size_t end)
{
    const phi_transpose *g = flow->g;
#if PHI_HANDS
    if (flow->go > 1) phi_hand_rows(s, flow->part, s->x, flow->bar, g->handed, first, end);
    else phi_back_rows(s, flow->part, flow->coef PHI_AND_FAR(g->far), s->x, flow->bar, g->handed, g->sums + flow->row * PHI_ROW, first, end);
#else
    phi_back_rows(s, flow->part, flow->coef PHI_AND_FAR(g->far), s->x, flow->bar, g->handed, g->sums + flow->row * PHI_ROW, first, end);
#endif
}

/* Go back through some flows, the last first; all threads come here at once. */
static void phi_go_all_back(const phi_solver *s, const phi_flow *flows, size_t count)
{
#if PHI_WAVES
    if (count > 1) {
        phi_make_wave(s, flows, count);
        return;
    }
#endif
    size_t first, end = phi_share(phi_units(s), &first);
    for (size_t k = 0; k < count; ++k) {
        phi_go_back(s, flows + k, first, end);
        phi_wait();
    }
}

#if !PHI_WAVES
enum { PHI_DEEPEST = 1 }; /* flows at once */
#endif

/* The way back through a flow of the step after so many, by its number, for those cotangents. */
static void phi_find_back(const phi_solver *s, const phi_transpose *g, size_t step, int number, double *const *bar, phi_flow *flow)
{
    phi_find_flow(s, step, number, flow);
    flow->go = 1;
    flow->row = number;
    flow->g = g;
    flow->bar = bar;
}

/* Pull cotangents back through so many steps, joined, after so many, and undo them: s->x becomes the fields before. */
static void phi_steps_back(const phi_solver *s, const phi_transpose *g, size_t before, size_t steps)
{
#if PHI_WAVES
    const size_t depth = phi_depth(s);
#else
    const size_t depth = 1;
#endif
    phi_flow flows[PHI_DEEPEST];
    size_t count = 0;
    for (size_t left = steps * PHI_OWN_FLOWS; left-- > 0;) {
        const size_t step = before + left / PHI_OWN_FLOWS;
        const int flow = (int)(left % PHI_OWN_FLOWS), number = flow == 0 && step > g->first_step ? PHI_FLOWS : flow;
        for (int go = 1, last = 1; go <= last; ++go) {
            phi_flow *next = flows + count++;
            phi_find_back(s, g, step, number, g->bar, next);
            next->go = go;
            last = 1 + phi_hands[next->part - 1];
            if (count < depth) continue;
            phi_go_all_back(s, flows, count);
            count = 0;
        }
    }
    phi_go_all_back(s, flows, count);
}

/* The state that a leg of a segment begins with. */
static void phi_fields_of_leg(const phi_transpose *g, size_t leg, double *fields[PHI_DIM])
{
    for (size_t f = 0; f < PHI_DIM; ++f) fields[f] = PHI_FIRST_SITE(g->kept + (leg * PHI_DIM + f) * g->block);
}

/* The largest value of a field, in an order that lets loops vectorise. */
static double phi_largest_of(const phi_solver *s, const double *field)
{
    double lanes[8] = { 0.0 };
    const ptrdiff_t whole = s->length - s->length % 8;
    PHI_EACH_ROW {
        const double *row = PHI_ROW_AT(field);
        for (ptrdiff_t i = 0; i < whole; i += 8)
            for (int l = 0; l < 8; ++l) lanes[l] = fabs(row[i + l]) > lanes[l] ? fabs(row[i + l]) : lanes[l];
        for (ptrdiff_t i = whole; i < s->length; ++i) lanes[0] = fabs(row[i]) > lanes[0] ? fabs(row[i]) : lanes[0];
    }
    for (int l = 1; l < 8; ++l) lanes[0] = lanes[l] > lanes[0] ? lanes[l] : lanes[0];
    return lanes[0];
}

/* Whether two fields differ by so little. */
static int phi_differ_by(const phi_solver *s, const double *one, const double *other, double most)
{
    int near = 1;
    PHI_EACH_ROW {
        const double *first = PHI_ROW_AT(one), *second = PHI_ROW_AT(other);
        for (ptrdiff_t i = 0; i < s->length; ++i) near &= fabs(first[i] - second[i]) <= most;
    }
    return near;
}

/* Stand where a leg began, of which all steps have been undone, unless that is another state. */
static phi_status phi_leave_leg(const phi_solver *s, phi_transpose *g, size_t leg)
{
    double *began[PHI_DIM], largest = 0.0;
    phi_fields_of_leg(g, leg, began);
    for (size_t f = 0; f < PHI_DIM; ++f) {
        const double size = phi_largest_of(s, began[f]);
        largest = size > largest ? size : largest;
    }
    if (!phi_all_hold(s, s->x)) return PHI_NOT_FINITE;
    for (size_t f = 0; f < PHI_DIM; ++f)
        if (g->leg > 1 && !phi_differ_by(s, s->x[f], began[f], PHI_UNLIKE * largest)) g->lost = 1;
    phi_copy(s->x, began, s);
    return g->lost ? PHI_NOT_FINITE : PHI_OK;
}

#else
/* Pull cotangents back through a flow in a step after so many; of its sweeps kept has the fields that they change, and
   ends with them; x becomes the fields before it. Returns where what was kept before begins. */
static double *phi_flow_back(const phi_solver *s, const phi_transpose *g, size_t steps, int number,
    double *kept, double **x, double *const *bar)
{
    phi_flow flow;
    phi_find_flow(s, steps, number, &flow);
    int last = 0;
    while (phi_sweep_of(s, number, last) >= 0) ++last;
    while (last-- > 0) {
        const int sweep = phi_sweep_of(s, number, last);
        for (int f = PHI_DIM - 1; f >= 0; --f)
            if (kept != NULL && phi_keeps[phi_part_of(s, sweep)][f]) {
                kept -= g->block;
                x[f] = PHI_FIRST_SITE(kept);
            }
        phi_sweep_back(s, g, sweep, flow.coef, number, x, bar);
    }
    return kept;
}

/* Pull the cotangents of all sweeps of the step after so many back, from where its sweeps have kept what they changed. */
static void phi_step_back(const phi_solver *s, phi_transpose *g, size_t steps, int joined, double *kept)
{
    PHI_PARALLEL
    {
        double *x[PHI_ARRAYS];
        double *left = kept + g->of_step;
        memcpy(x, g->x, sizeof x);
        for (int flow = PHI_OWN_FLOWS - 1; flow >= 0; --flow)
            left = phi_flow_back(s, g, steps, flow == 0 && joined ? PHI_FLOWS : flow, left, x, g->bar);
    }
    double *left = kept; /* what the step began with */
    int seen[PHI_DIM] = { 0 };
    for (int flow = 0; flow < PHI_OWN_FLOWS; ++flow)
        for (int k = 0, sweep; (sweep = phi_sweep_of(s, flow, k)) >= 0; ++k)
            for (int f = 0; f < PHI_DIM; ++f) {
                if (!phi_keeps[phi_part_of(s, sweep)][f]) continue;
                if (!seen[f]) g->x[f] = PHI_FIRST_SITE(left);
                seen[f] = 1;
                left += g->block;
            }
}

#endif
/* Pull the cotangent of a row back, which is the state after so many steps, and add it. */
static void phi_row_back(const phi_solver *s, phi_transpose *g, size_t steps, const double *row_bar)
{
    for (size_t f = 0; f < PHI_DIM; ++f) phi_put(s, g->row_bar[f], row_bar + f * s->sites);
    PHI_PARALLEL
    {
#if PHI_UNDONE
        if (PHI_FLOWS > 1) {
            phi_flow last;
            phi_find_back(s, g, steps - 1, PHI_FLOWS - 1, g->row_bar, &last);
            phi_sweep_part(s, last.part, last.coef PHI_AND_FAR(g->far)); /* to be undone */
            phi_go_all_back(s, &last, 1);
            last.go = 2;
            phi_go_all_back(s, &last, phi_hands[last.part - 1]);
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
#if PHI_UNDONE
#if PHI_HALO
                phi_ends(to, s->length, row.from, row.to);
#endif
#endif
            }
        }
    }
}

/* Take the steps from done to until, of a run that has not ended before; rows, where not NULL, get the states after stride, 2 stride, ...
   steps and at the end. What the way back needs is kept if so wanted. */
static phi_status phi_walk(phi_solver *s, phi_transpose *g, size_t done, size_t until, size_t stride, size_t steps,
    double *rows, int keeping)
{
    phi_status status = PHI_OK;
#if PHI_UNDONE
    const size_t begin = done;
#else
    s->kept = keeping ? g->kept : NULL;
#endif
    while (done < until && status == PHI_OK) {
        const size_t row = done / stride + 1, left = until - done, ahead = row * stride - done;
        const size_t most = PHI_UNASKED / s->sites + 1, wanted = rows == NULL || left < ahead ? left : ahead;
#if PHI_UNDONE
        const size_t leg = keeping ? g->leg - (done - begin) % g->leg : wanted, less = wanted < leg ? wanted : leg;
        const size_t now = less < most ? less : most;
        if (keeping && (done - begin) % g->leg == 0) {
            double *fields[PHI_DIM];
            phi_fields_of_leg(g, (done - begin) / g->leg, fields);
            phi_copy(fields, s->x, s);
        }
#else
        const size_t now = wanted < most ? wanted : most;
#endif
        status = phi_march(s, now);
        done += now;
        if (status == PHI_OK && phi_is_stopped(s, g, now)) status = PHI_STOPPED;
        if (status != PHI_OK || rows == NULL || (done != steps && done % stride != 0)) continue;
#if !PHI_UNDONE
        double *const kept = s->kept;
        s->kept = NULL;
#endif
#if PHI_NEAR
        if (s->open && !phi_close(s)) status = PHI_NOT_FINITE;
#else
        if (s->open && !phi_try(s, 0)) status = PHI_NOT_FINITE;
#endif
        phi_take(s, s->x, rows + (row - 1) * PHI_DIM * s->sites);
        phi_copy(s->x, s->before, s);
#if !PHI_UNDONE
        s->kept = kept;
#endif
    }
#if !PHI_UNDONE
    s->kept = NULL;
#endif
    return status;
}

/* Stand after all steps, or before them. */
static phi_status phi_settle(phi_solver *s, phi_transpose *g, size_t steps, phi_status status)
{
    if (status != PHI_OK || steps == 0) {
        g->count = 1;
        phi_return(s, g);
        return status;
    }
    phi_copy(s->x, g->end, s);
    phi_copy(s->before, g->end, s);
    s->far = g->last_far;
    s->steps = g->first_step + steps;
    s->open = PHI_FLOWS > 1;
#if PHI_NEAR
    if (s->open && !phi_close(s)) status = PHI_NOT_FINITE;
#else
    if (s->open && !phi_try(s, 0)) status = PHI_NOT_FINITE;
#endif
    s->t = s->t_before_h + (double)(s->steps - s->steps_before_h) * s->h;
#if PHI_TIMED
    s->now = s->t;
#endif
    return status;
}
#endif
