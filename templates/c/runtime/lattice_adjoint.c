#ifndef PHI_FILE_LATTICE_ADJOINT
#define PHI_FILE_LATTICE_ADJOINT
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"

/* ---- The transpose of steps ---- */
#if PHI_SHARES
#if PHI_GATHER
enum { PHI_ADDED = 2 * PHI_PIECE }; /* sites whose shares in a sum are kept apart before they are added */
#else
enum { PHI_ADDED = 256 }; /* sites whose shares in a sum are kept apart before they are added */
#endif

/* The sum of some values, in an order that lets loops vectorise. */
static inline double phi_added(const double *values, ptrdiff_t count)
{
    double lanes[8] = { 0.0 }, sum = 0.0;
    const ptrdiff_t whole = count - count % 8;
    for (ptrdiff_t i = 0; i < whole; i += 8)
        for (int l = 0; l < 8; ++l) lanes[l] += values[i + l];
    for (ptrdiff_t i = whole; i < count; ++i) sum += values[i];
    for (int l = 0; l < 8; ++l) sum += lanes[l];
    return sum;
}

#endif
#if !PHI_ONE_ROW
/* The rows from which a row is handed what is its own; beyond open ends a row of zeros after all others. */
static void phi_find_givers(const phi_solver *s, size_t index, ptrdiff_t at[PHI_LINES])
{
    ptrdiff_t place[PHI_AXES];
    phi_place(s, index, place);
    for (int k = 0; k < PHI_LINES; ++k) {
        at[k] = s->lines[index * PHI_LINES + (size_t)k];
        for (int a = 0; a < PHI_AXES - 1; ++a) {
            const ptrdiff_t p = place[a] + phi_lines[k][a];
            if (phi_open[a] && (p < 0 || p >= (ptrdiff_t)s->sizes[a])) at[k] = (ptrdiff_t)s->rows * s->width;
        }
    }
}

#endif
#include "adjoint_sweeps.h"

/* What is pulled back through steps, and the memory for it. */
typedef struct {
    double *bar[PHI_BARS];       /* cotangents of the fields, then of parameters at sites, and at the bonds of each site */
    double *row_bar[PHI_BARS];   /* those of the fields of one row, and the same of parameters */
    double *handed[PHI_HANDED];  /* what sites hand to those that they have read */
    double *sums;                /* of each piece of a row those of the coefficients */
    double *kept;                /* of each step of a segment, and each of its sweeps, the fields before that it changes */
    double *x[PHI_ARRAYS];       /* the fields before what was gone back through last */
    double *end[PHI_DIM];        /* what steps after the last go on from, */
    size_t last_far;             /* and how many of these by functions for large arguments */
    size_t block, of_step;       /* numbers of one field, and that a step keeps */
    double *states;              /* what segments begin with ... */
    size_t *marks;               /* ... and of each the number of its step, then of steps by functions for large arguments */
    size_t most, count;          /* how many there may be, and are */
    size_t longest;              /* most steps of a segment */
    size_t first_step;           /* steps that were made before */
} phi_transpose;

/* The sweep of that number in a flow; -1 if there are no more. */
static int phi_sweep_of(const phi_solver *s, int flow, int number)
{
    const int part = phi_flow_parts[flow == PHI_FLOWS ? 0 : flow];
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

/* The sweeps that steps consist of where they are joined: without the last flow, unless that is all. */
#define PHI_OWN_FLOWS (PHI_FLOWS > 1 ? PHI_FLOWS - 1 : 1)

/* The numbers that a step keeps. */
static size_t phi_numbers_kept(const phi_solver *s)
{
    size_t fields = 0;
    for (int flow = 0; flow < PHI_OWN_FLOWS; ++flow)
        for (int k = 0, sweep; (sweep = phi_sweep_of(s, flow, k)) >= 0; ++k)
            for (int f = 0; f < PHI_DIM; ++f) fields += phi_moves[phi_part_of(s, sweep)][f];
    return fields * phi_block(s->rows, s->width);
}

/* Keep the fields that a sweep will change; returns where the next ones are kept. */
static double *phi_keep(const phi_solver *s, int sweep, double *to)
{
    size_t first, end = phi_share(phi_units(s), &first);
    for (int f = 0; f < PHI_DIM; ++f) {
        if (!phi_moves[phi_part_of(s, sweep)][f]) continue;
        for (size_t unit = first; unit < end; ++unit) {
            const phi_piece at = phi_piece_of(s, unit);
            double *row = to + PHI_LEAD + at.row.at[0];
            memcpy(row + at.from, s->x[f] + at.row.at[0] + at.from, (size_t)(at.to - at.from) * sizeof *row);
#if PHI_HALO
            phi_ends(row, s->length, at.from, at.to);
#endif
        }
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
                phi_sweep_colour(s, sweep, flow.coef, s->far > 0);
#else
                phi_sweep_part(s, sweep, flow.coef, s->far > 0);
#endif
            }
        }
    }
}

/* Pull cotangents back through one sweep, x being the fields before it. */
static void phi_sweep_back(const phi_solver *s, const phi_transpose *g, int sweep, const double *coef, int row,
    double *const *x, double *const *bar)
{
    size_t first, end = phi_share(phi_units(s), &first);
    phi_back_rows(s, sweep, coef, x, bar, g->handed, g->sums + row * PHI_ROW, first, end);
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

/* Pull cotangents back through a flow in a step after so many; of its sweeps kept has the fields that they change, and
   ends with them; x becomes the fields before it. Returns where what was kept before begins. */
static double *phi_flow_back(const phi_solver *s, const phi_transpose *g, size_t steps, int number,
    double *kept, double **x, double *const *bar)
{
    const int row = number == PHI_FLOWS ? PHI_JOINED : phi_flow_rows[number];
    phi_flow flow;
    phi_find_flow(s, steps, number, &flow);
    int last = 0;
    while (phi_sweep_of(s, number, last) >= 0) ++last;
    while (last-- > 0) {
        const int sweep = phi_sweep_of(s, number, last);
        for (int f = PHI_DIM - 1; f >= 0; --f)
            if (kept != NULL && phi_moves[phi_part_of(s, sweep)][f]) {
                kept -= g->block;
                x[f] = kept + PHI_LEAD;
            }
        phi_sweep_back(s, g, sweep, flow.coef, row, x, bar);
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
                if (!phi_moves[phi_part_of(s, sweep)][f]) continue;
                if (!seen[f]) g->x[f] = left + PHI_LEAD;
                seen[f] = 1;
                left += g->block;
            }
}

/* Pull the cotangent of a row back, which is the state after so many steps, and add it. */
static void phi_row_back(const phi_solver *s, phi_transpose *g, size_t steps, const double *row_bar)
{
    for (size_t f = 0; f < PHI_DIM; ++f) phi_put(s, g->row_bar[f], row_bar + f * s->sites);
    PHI_PARALLEL
    {
        double *x[PHI_ARRAYS];
        memcpy(x, g->x, sizeof x);
        if (PHI_FLOWS > 1) phi_flow_back(s, g, steps - 1, PHI_FLOWS - 1, NULL, x, g->row_bar);
        size_t first, end = phi_share(phi_units(s), &first);
        for (size_t unit = first; unit < end; ++unit) {
            const phi_piece at = phi_piece_of(s, unit);
            for (int f = 0; f < PHI_DIM; ++f) {
                const double *restrict from = g->row_bar[f] + at.row.at[0];
                double *restrict to = g->bar[f] + at.row.at[0];
                for (ptrdiff_t i = at.from; i < at.to; ++i) to[i] += from[i];
            }
        }
    }
}

/* The cotangents of coefficients: sums over all pieces, in their order, which are 0 then. */
static void phi_add_up(const phi_solver *s, phi_transpose *g, double coef_bar[PHI_COEFFICIENTS])
{
    const size_t units = phi_units(s);
    for (size_t unit = 0; unit < units; ++unit)
        for (size_t k = 0; k < PHI_COEFFICIENTS; ++k) {
            coef_bar[k] += g->sums[unit * PHI_COEFFICIENTS + k];
            g->sums[unit * PHI_COEFFICIENTS + k] = 0.0;
        }
}

#if PHI_RENEWED
/* The same after a step after so many others, where those of what depends on the time are pulled back to the others. */
static void phi_add_up_step(const phi_solver *s, phi_transpose *g, size_t steps, double coef_bar[PHI_COEFFICIENTS])
{
    double found[PHI_COEFFICIENTS] = { 0.0 }, coef[PHI_ROW], early[PHI_PREPARED];
    phi_add_up(s, g, found);
    for (int row = 0; row < PHI_ROWS_OF_FLOWS; ++row) {
        double *own = found + row * PHI_ROW;
        phi_renew(s, row, steps, coef);
        phi_refresh_adjoint(coef, phi_time_after(s, steps) + phi_moments[row] * s->h, own + PHI_PREPARED, early);
        for (int k = 0; k < PHI_PREPARED; ++k) coef_bar[row * PHI_ROW + k] += own[k] + early[k];
    }
}

#endif
/* Take the steps from done to until, of a run that has not ended before; rows, where not NULL, get the states after stride, 2 stride, ...
   steps and at the end. What their sweeps change is kept if so wanted. */
static phi_status phi_walk(phi_solver *s, phi_transpose *g, size_t done, size_t until, size_t stride, size_t steps,
    double *rows, int keeping)
{
    phi_status status = PHI_OK;
    s->kept = keeping ? g->kept : NULL;
    while (done < until && status == PHI_OK) {
        const size_t row = done / stride + 1, left = until - done, ahead = row * stride - done;
        const size_t now = rows == NULL || left < ahead ? left : ahead;
        status = phi_march(s, now);
        done += now;
        if (status != PHI_OK || rows == NULL || (done != steps && done % stride != 0)) continue;
        double *const kept = s->kept;
        s->kept = NULL;
#if PHI_NEAR
        if (s->open && !phi_close(s)) status = PHI_NOT_FINITE;
#else
        if (s->open && !phi_try(s, 0)) status = PHI_NOT_FINITE;
#endif
        phi_take(s, s->x, rows + (row - 1) * PHI_DIM * s->sites);
        phi_copy(s->x, s->before, s);
        s->kept = kept;
    }
    s->kept = NULL;
    return status;
}

#if PHI_BOND_PARAMETERS
/* Room for values at the bonds of each site. */
static size_t phi_at_bonds(const phi_solver *s) { return ((size_t)s->bonds[s->sites] + 7) / 8 * 8; }

#endif
/* The numbers that any transpose has room for. */
static size_t phi_always(const phi_solver *s)
{
    const size_t block = phi_block(s->rows, s->width), units = phi_units(s);
    size_t numbers = (PHI_ARRAYS + 2 * PHI_DIM) * block + PHI_HANDED * (block + (size_t)s->width);
#if PHI_BOND_PARAMETERS
    numbers += PHI_BOND_ARRAYS * phi_at_bonds(s);
#endif
    return numbers + units * PHI_COEFFICIENTS;
}

/* The bytes of the state that a segment begins with. */
static size_t phi_state_size(const phi_solver *s)
{
    return PHI_DIM * phi_block(s->rows, s->width) * sizeof(double) + 2 * sizeof(size_t);
}

size_t phi_trail_size(const phi_solver *s, size_t steps)
{
    const size_t of_step = phi_numbers_kept(s) * sizeof(double);
    if (steps > SIZE_MAX / 8 / of_step) return 0;
    return phi_always(s) * sizeof(double) + steps * of_step + phi_state_size(s) + 64;
}

/* Share memory out, all that is not taken in any case between what the steps of a segment keep and the states that segments
   begin with: as few of these as there may be, or half and half where all that is too little for two runs. */
static void phi_place_transpose(const phi_solver *s, phi_transpose *g, size_t steps, void *memory, size_t size)
{
    double *next = (double *)(void *)((char *)memory + (64 - (uintptr_t)memory % 64) % 64);
    const size_t block = phi_block(s->rows, s->width), room = size - 64 - phi_always(s) * sizeof *next;
    const size_t of_state = phi_state_size(s);
    memset(next, 0, phi_always(s) * sizeof *next);
    memset(g, 0, sizeof *g);
    g->block = block;
    g->of_step = phi_numbers_kept(s);
    const size_t of_step = g->of_step * sizeof *next, fit = (room - of_state) / of_step;
    g->longest = fit < steps ? fit : steps > 0 ? steps : 1;
    while (g->longest > 1 && (room - g->longest * of_step) / of_state < steps / g->longest + 1)
        g->longest -= (g->longest + 7) / 8;
    g->most = (room - g->longest * of_step) / of_state;
    if (g->most < steps / g->longest + 1) {
        g->longest = fit > 2 ? fit / 2 : 1;
        g->most = (room - g->longest * of_step) / of_state;
    }
    for (int f = 0; f < PHI_ARRAYS; ++f, next += block) g->bar[f] = g->row_bar[f] = next + PHI_LEAD;
    for (int f = 0; f < PHI_DIM; ++f, next += block) g->row_bar[f] = next + PHI_LEAD;
    for (int f = 0; f < PHI_DIM; ++f, next += block) g->end[f] = next + PHI_LEAD;
    for (int k = 0; k < PHI_HANDED; ++k, next += block + (size_t)s->width) g->handed[k] = next + PHI_LEAD;
#if PHI_BOND_PARAMETERS
    for (int k = PHI_ARRAYS; k < PHI_BARS; ++k, next += phi_at_bonds(s)) g->bar[k] = g->row_bar[k] = next;
#endif
    g->states = next;
    g->kept = next + g->most * PHI_DIM * block;
    g->sums = g->kept + g->longest * g->of_step;
    g->marks = (size_t *)(void *)(g->sums + phi_units(s) * PHI_COEFFICIENTS);
    memset(g->sums, 0, phi_units(s) * PHI_COEFFICIENTS * sizeof *next);
}

/* The fields of the state that a segment begins with. */
static void phi_fields_of_state(const phi_transpose *g, size_t number, double *fields[PHI_DIM])
{
    for (size_t f = 0; f < PHI_DIM; ++f) fields[f] = g->states + (number * PHI_DIM + f) * g->block + PHI_LEAD;
}

/* Another segment begins here, after so many steps. */
static void phi_mark(const phi_solver *s, phi_transpose *g, size_t done)
{
    double *fields[PHI_DIM];
    phi_fields_of_state(g, g->count, fields);
    phi_copy(fields, s->x, s);
    g->marks[2 * g->count] = done;
    g->marks[2 * g->count + 1] = s->far;
    ++g->count;
}

/* Go back to where the last segment begins; returns the number of its step. */
static size_t phi_return(phi_solver *s, const phi_transpose *g)
{
    double *fields[PHI_DIM];
    const size_t done = g->marks[2 * (g->count - 1)];
    phi_fields_of_state(g, g->count - 1, fields);
    phi_copy(s->x, fields, s);
    phi_copy(s->before, fields, s);
    s->far = g->marks[2 * (g->count - 1) + 1];
    s->steps = g->first_step + done;
    s->open = PHI_FLOWS > 1 && done > 0;
    return done;
}

/* Add the cotangents of parameters, those of numbers by way of the coefficients. */
static void phi_add_parameters(const phi_solver *s, const phi_transpose *g, const double coef_bar[PHI_COEFFICIENTS],
    phi_params_bar *params_bar)
{
#if PHI_NUMBERED
    for (int row = 0; row < PHI_ROWS_OF_FLOWS; ++row) {
        double found[PHI_NUMBERS] = { 0.0 };
#if PHI_KICKS
        const double kick[1] = { phi_multiples[row] * (s->h * s->h) };
        phi_prepare_adjoint(&s->params, phi_times[row] * s->h, kick, coef_bar + row * PHI_ROW, found);
#else
        phi_prepare_adjoint(&s->params, phi_times[row] * s->h, coef_bar + row * PHI_ROW, found);
#endif
        phi_add_numbers(found, params_bar);
    }
#else
    (void)coef_bar;
#endif
    phi_add_arrays(s, g->bar, params_bar);
}

/* How many steps the next segment has of those that are left. */
static size_t phi_onward(const phi_transpose *g, size_t left)
{
    const size_t free = g->most - g->count, parts = free > 1 ? free / 2 + 1 : 2;
    if (left <= g->longest * (free + 1)) return g->longest;
    return (left + parts - 1) / parts;
}

/* Cotangents of rows, pulled back through the steps from done to until, the last of a segment: s stands at its end. */
static void phi_segment_back(phi_solver *s, phi_transpose *g, size_t done, size_t until, size_t stride, size_t steps,
    const double *rows_bar, double coef_bar[PHI_COEFFICIENTS])
{
    memcpy(g->x, s->x, sizeof g->x);
    for (size_t k = until; k > done; --k) {
        const size_t row = (k - 1) / stride;
        if (k == steps || k % stride == 0) phi_row_back(s, g, g->first_step + k, rows_bar + row * PHI_DIM * s->sites);
        phi_step_back(s, g, g->first_step + k - 1, k > 1, g->kept + (k - 1 - done) * g->of_step);
#if PHI_RENEWED
        phi_add_up_step(s, g, g->first_step + k - 1, coef_bar);
#else
        (void)coef_bar;
#endif
    }
}

/* All steps of a run and all segments of it, from the last. */
static phi_status phi_run_back(phi_solver *s, phi_transpose *g, size_t steps, size_t stride, double *rows,
    const double *rows_bar, double coef_bar[PHI_COEFFICIENTS])
{
    phi_status status = PHI_OK;
    for (size_t end = steps, done; end > 0 && status == PHI_OK; end = done) {
        double *const made = end == steps ? rows : NULL;
        done = phi_return(s, g);
        while (end - done > g->longest && status == PHI_OK) {
            const int free = g->count < g->most;
            const size_t next = free ? done + phi_onward(g, end - done) : end - g->longest;
            status = phi_walk(s, g, done, next, stride, steps, made, 0);
            done = next;
            if (free && status == PHI_OK) phi_mark(s, g, done);
        }
        if (status == PHI_OK) status = phi_walk(s, g, done, end, stride, steps, made, 1);
        if (status != PHI_OK) break;
        if (end == steps) {
            phi_copy(g->end, s->x, s);
            g->last_far = s->far;
        }
        phi_segment_back(s, g, done, end, stride, steps, rows_bar, coef_bar);
        if (g->count > 1 && done == g->marks[2 * (g->count - 1)]) --g->count;
    }
#if !PHI_RENEWED
    phi_add_up(s, g, coef_bar);
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

phi_status phi_pullback(phi_solver *s, double h, size_t steps, size_t stride, double *rows, const double *rows_bar,
    double *x0_bar, phi_params_bar *params_bar, void *trail, size_t size)
{
    if (s == NULL || (rows_bar == NULL && steps > 0) || x0_bar == NULL || trail == NULL || stride == 0)
        return PHI_BAD_ARGUMENT;
    if (size < phi_trail_size(s, 1)) return PHI_BAD_ARGUMENT;
    phi_status status = phi_set_step(s, h);
    if (status != PHI_OK) return status;
    phi_transpose g;
    double coef_bar[PHI_COEFFICIENTS] = { 0.0 };
    phi_place_transpose(s, &g, steps, trail, size);
    g.first_step = s->steps;
    s->open = 0;
    phi_mark(s, &g, 0);
    status = phi_run_back(s, &g, steps, stride, rows, rows_bar, coef_bar);
    if (status == PHI_OK && !phi_all_hold(s, g.bar)) status = PHI_NOT_FINITE;
    status = phi_settle(s, &g, steps, status);
    if (status != PHI_OK) return status;
    phi_take(s, g.bar, x0_bar);
    if (params_bar != NULL) phi_add_parameters(s, &g, coef_bar, params_bar);
    return PHI_OK;
}

phi_status phi_step_adjoint(phi_solver *s, double h, const double *x1_bar, double *x0_bar, phi_params_bar *params_bar,
    void *trail)
{
    if (s == NULL) return PHI_BAD_ARGUMENT;
    return phi_pullback(s, h, 1, 1, NULL, x1_bar, x0_bar, params_bar, trail, phi_trail_size(s, 1));
}
#endif
