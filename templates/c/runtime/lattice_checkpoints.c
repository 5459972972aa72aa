#ifndef PHI_FILE_LATTICE_CHECKPOINTS
#define PHI_FILE_LATTICE_CHECKPOINTS
#include <float.h>
#include <stdint.h>
#include <string.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "lattice_back.c"

/* ---- Checkpoints and tape ---- */
#if !PHI_SERIES
/* Number of flows that a step of a run makes, since the last flow of a step is merged with the first flow of the next
   one. */
#define PHI_OWN_FLOWS (PHI_FLOWS > 1 ? PHI_FLOWS - 1 : 1)

/* Number of the row of coefficients for a flow of a step. If continues = 1, the first flow is merged with the last flow
   of the step before, and uses row PHI_FLOWS. */
static int phi_joined(int flow, int continues) { return PHI_FLOWS > 1 && flow == 0 && continues ? PHI_FLOWS : flow; }

#endif
/* The reverse pass of a run: derivatives of a number L, and checkpoints and tape of the forward pass. */
typedef struct phi_transpose {
#include "state_of_transpose.h"
} phi_transpose;

#if PHI_SERIES
/* Number of doubles on the tape for one step. */
static size_t phi_step_tape_size(const phi_solver *s) { return PHI_ALL_STAGES((size_t)PHI_STORED_STATES) * PHI_DIM * phi_block(s->rows, s->width); }

/* Set the number of steps made, and the time that belongs to it. */
static void phi_stand(phi_solver *s, size_t steps)
{
    s->steps = steps;
    s->t = s->t_before_h + (double)(steps - s->steps_before_h) * s->h;
#if PHI_TIMED
    s->now = s->t;
#endif
}

#endif
#if PHI_BOND_PARAMETERS
/* Number of doubles in an array over the ends of all bonds, padded to a multiple of 8. */
static size_t phi_at_bonds(const phi_solver *s) { return ((size_t)s->bonds[s->sites] + 7) / 8 * 8; }

#endif
/* Number of doubles that a reverse pass needs besides tape and checkpoints. */
static size_t phi_always(const phi_solver *s)
{
    const size_t block = phi_block(s->rows, s->width), units = phi_units(s);
    size_t numbers = (PHI_ARRAYS + 2 * PHI_DIM) * block + PHI_HANDED * (block + (size_t)s->width);
#if PHI_BOND_PARAMETERS
    numbers += PHI_BOND_ARRAYS * phi_at_bonds(s);
#endif
    return numbers + units * PHI_SUMS;
}

/* Number of bytes of a checkpoint, which holds the state at the start of a segment. */
static size_t phi_state_size(const phi_solver *s)
{
    return PHI_DIM * phi_block(s->rows, s->width) * sizeof(double) + 2 * sizeof(size_t);
}

#include "lattice_tape_recomputed.c"
#include "lattice_tape_stored.c"

#if !PHI_SERIES
enum { PHI_BESIDE_CORE = 1 << 19 }; /* bytes of cache that the tape of a segment may fill */

#endif
/* Whether `room` bytes hold the tape of a segment of `longest` steps and the checkpoints of all segments. */
static int phi_fits(size_t room, size_t longest, size_t of_step, size_t of_state, size_t steps)
{
    return (room - longest * of_step) / of_state > steps / longest;
}

#if PHI_SERIES
/* Divide the memory between the tape of one segment and checkpoints. Segments are as long as possible such that all
   their checkpoints have room; each step is then made at most twice. If checkpoints of all segments never have room,
   tape and checkpoints get one half each. */
#else
/* Divide the memory between the tape of one segment and checkpoints. The tape of a segment fills the cache, or more if
   the checkpoints of all segments would not have room otherwise; each step is then made at most twice. If they never
   have room, tape and checkpoints get one half each. */
#endif
static void phi_place_transpose(const phi_solver *s, phi_transpose *g, size_t steps, void *memory, size_t size)
{
    double *next = (double *)(void *)((char *)memory + (64 - (uintptr_t)memory % 64) % 64);
    const size_t block = phi_block(s->rows, s->width), room = size - 64 - phi_always(s) * sizeof *next;
    const size_t of_state = phi_state_size(s);
    memset(next, 0, phi_always(s) * sizeof *next);
    g->block = block;
#if PHI_RECOMPUTED
    const size_t of_step = phi_leg_size(s); /* here steps are counted in legs: groups of steps with one state on the tape */
    steps = phi_legs(steps, g->leg);
#else
    g->of_step = phi_step_tape_size(s);
    const size_t of_step = g->of_step * sizeof *next;
#endif
    const size_t fit = (room - of_state) / of_step;
    g->longest = steps > 0 ? steps : 1;
    if (fit < steps) {
#if PHI_SERIES
        g->longest = fit;
        while (g->longest > 1 && !phi_fits(room, g->longest, of_step, of_state, steps)) --g->longest;
#else
        g->longest = of_step < PHI_BESIDE_CORE ? PHI_BESIDE_CORE / of_step : 1;
        if (g->longest > fit) g->longest = fit;
        while (g->longest < fit && !phi_fits(room, g->longest, of_step, of_state, steps)) ++g->longest;
#endif
        if (!phi_fits(room, g->longest, of_step, of_state, steps)) g->longest = fit > 2 ? fit / 2 : 1;
    }
    g->most = (room - g->longest * of_step) / of_state;
    for (int f = 0; f < PHI_ARRAYS; ++f, next += block) g->bar[f] = g->row_bar[f] = PHI_FIRST_SITE(next);
    for (int f = 0; f < PHI_DIM; ++f, next += block) g->row_bar[f] = PHI_FIRST_SITE(next);
    for (int f = 0; f < PHI_DIM; ++f, next += block) g->end[f] = PHI_FIRST_SITE(next);
    for (int k = 0; k < PHI_HANDED; ++k, next += block + (size_t)s->width) g->handed[k] = PHI_FIRST_SITE(next);
#if PHI_BOND_PARAMETERS
    for (int k = PHI_ARRAYS; k < PHI_BARS; ++k, next += phi_at_bonds(s)) g->bar[k] = g->row_bar[k] = next;
#endif
    g->states = next;
    g->tape = next + g->most * PHI_DIM * block;
    g->sums = g->tape + g->longest * (of_step / sizeof *next);
    g->marks = (size_t *)(void *)(g->sums + phi_units(s) * PHI_SUMS);
    memset(g->sums, 0, phi_units(s) * PHI_SUMS * sizeof *next);
#if PHI_RECOMPUTED
    g->longest *= g->leg;
#endif
}

enum { PHI_UNASKED = 1 << 22 }; /* site updates between calls of s->stop */

/* Whether the caller wants to stop: calls s->stop if there were PHI_UNASKED site updates since its last call. `steps`
   is the number of steps made since the last call of the present function. */
static int phi_is_stopped(const phi_solver *s, phi_transpose *g, size_t steps)
{
    g->unasked += steps * s->sites;
    if (s->stop == NULL || g->unasked < PHI_UNASKED) return 0;
    g->unasked = 0;
    return s->stop();
}

/* Set fields to the arrays of checkpoint `number`. */
static void phi_fields_of_state(const phi_transpose *g, size_t number, double *fields[PHI_DIM])
{
    for (size_t f = 0; f < PHI_DIM; ++f) fields[f] = PHI_FIRST_SITE(g->states + (number * PHI_DIM + f) * g->block);
}

/* Store the present state as a checkpoint; `done` is its number of steps since the start of the run. */
static void phi_mark(const phi_solver *s, phi_transpose *g, size_t done)
{
    double *fields[PHI_DIM];
    phi_fields_of_state(g, g->count, fields);
    phi_copy(fields, s->x, s);
    g->marks[2 * g->count] = done;
#if !PHI_SERIES
    g->marks[2 * g->count + 1] = s->full_range;
#endif
    ++g->count;
}

/* Set the solver to the last checkpoint; returns its number of steps since the start of the run. */
static size_t phi_return(phi_solver *s, const phi_transpose *g)
{
    double *fields[PHI_DIM];
    const size_t done = g->marks[2 * (g->count - 1)];
    phi_fields_of_state(g, g->count - 1, fields);
    phi_copy(s->x, fields, s);
#if PHI_SERIES
    phi_stand(s, g->first_step + done);
    phi_forget(s);
#else
    phi_copy(s->before, fields, s);
    s->full_range = g->marks[2 * (g->count - 1) + 1];
    s->steps = g->first_step + done;
    s->open = PHI_FLOWS > 1 && done > 0;
#endif
    return done;
}
#endif
