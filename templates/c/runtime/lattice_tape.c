#ifndef PHI_FILE_LATTICE_TAPE
#define PHI_FILE_LATTICE_TAPE
#include <string.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "lattice_checkpoints.c"

/* ---- Tape of fields ---- */
/* Number of doubles on the tape for one step. */
static size_t phi_step_tape_size(const phi_solver *s)
{
    size_t fields = 0;
    for (int flow = 0; flow < PHI_OWN_FLOWS; ++flow)
        for (int k = 0, sweep; (sweep = phi_sweep_of(s, flow, k)) >= 0; ++k)
            for (int f = 0; f < PHI_DIM; ++f) fields += phi_stored_fields[phi_part_of(s, sweep)][f];
    return (fields > 0 ? fields : 1) * phi_block(s->rows, s->width);
}

/* Write to the tape the fields that a sweep will change and that the reverse pass reads; returns the new end of the tape. */
static double *phi_store_fields(const phi_solver *s, int sweep, double *to)
{
    size_t first, end = phi_share(phi_units(s), &first);
    for (int f = 0; f < PHI_DIM; ++f) {
        if (!phi_stored_fields[phi_part_of(s, sweep)][f]) continue;
        phi_store_units(s, PHI_MEMORY_OF(s->x[f]), to, first, end);
        to += phi_block(s->rows, s->width);
    }
    return to;
}

/* Make one step or more, and write the tape to s->tape. The last flow of the last step is left out. */
static void phi_make_steps_with_tape(const phi_solver *s, size_t steps)
{
    const size_t of_step = phi_step_tape_size(s);
    PHI_PARALLEL
    for (size_t step = 0; step < steps; ++step) {
        double *tape = s->tape + step * of_step;
        for (int number = 0; number < PHI_OWN_FLOWS; ++number) {
            const int merged_number = phi_joined(number, step > 0 || s->open);
            phi_flow flow;
            phi_set_flow(s, s->steps + step, merged_number, &flow);
            for (int k = 0, sweep; (sweep = phi_sweep_of(s, merged_number, k)) >= 0; ++k) {
                tape = phi_store_fields(s, sweep, tape);
#if PHI_BY_COLOUR
                phi_sweep_colour(s, sweep, flow.coef PHI_AND_FULL_RANGE(s->full_range > 0));
#else
                phi_sweep_part(s, sweep, flow.coef PHI_AND_FULL_RANGE(s->full_range > 0));
#endif
            }
        }
    }
}

/* Pull cotangents back through one sweep; x are the fields before it. */
static void phi_sweep_back(const phi_solver *s, const phi_transpose *g, int sweep, const double *coef, int row,
    double *const *x, double *const *bar)
{
    size_t first, end = phi_share(phi_units(s), &first);
    phi_back_rows(s, sweep, coef PHI_AND_FULL_RANGE(g->full_range), x, bar, g->handed, g->sums + row * PHI_ROW, first, end);
#if PHI_HANDS
    if (!phi_hands[phi_part_of(s, sweep)]) return;
    phi_wait();
#if PHI_GATHER
    phi_hand_rows(s, sweep, coef PHI_AND_FULL_RANGE(g->full_range), x, bar, g->handed, g->sums + row * PHI_ROW, first, end);
#else
    phi_hand_rows(s, sweep, x, bar, g->handed, first, end);
#endif
    phi_wait();
#endif
}

/* Pull the cotangents bar back through a flow. The fields that the tape holds for this flow end at `tape`, which may be
   NULL if there are none. x becomes the fields before the flow. Returns where the fields of the flow begin on the tape.
   */
static double *phi_flow_back(const phi_solver *s, const phi_transpose *g, size_t steps, int number,
    double *tape, double **x, double *const *bar)
{
    phi_flow flow;
    phi_set_flow(s, steps, number, &flow);
    int last = 0;
    while (phi_sweep_of(s, number, last) >= 0) ++last;
    while (last-- > 0) {
        const int sweep = phi_sweep_of(s, number, last);
        for (int f = PHI_DIM - 1; f >= 0; --f)
            if (tape != NULL && phi_stored_fields[phi_part_of(s, sweep)][f]) {
                tape -= g->block;
                x[f] = PHI_FIRST_SITE(tape);
            }
        phi_sweep_back(s, g, sweep, flow.coef, number, x, bar);
    }
    return tape;
}

/* Pull the cotangents back through one step, whose fields on the tape begin at `tape`. */
static void phi_step_back(const phi_solver *s, phi_transpose *g, size_t steps, int continues, double *tape)
{
    PHI_PARALLEL
    {
        double *x[PHI_ARRAYS];
        double *left = tape + g->of_step;
        memcpy(x, g->x, sizeof x);
        for (int flow = PHI_OWN_FLOWS - 1; flow >= 0; --flow)
            left = phi_flow_back(s, g, steps, phi_joined(flow, continues), left, x, g->bar);
    }
    double *left = tape; /* the following loops set g->x to the fields at the start of the step */
    int passed[PHI_DIM] = { 0 };
    for (int flow = 0; flow < PHI_OWN_FLOWS; ++flow)
        for (int k = 0, sweep; (sweep = phi_sweep_of(s, flow, k)) >= 0; ++k)
            for (int f = 0; f < PHI_DIM; ++f) {
                if (!phi_stored_fields[phi_part_of(s, sweep)][f]) continue;
                if (!passed[f]) g->x[f] = PHI_FIRST_SITE(left);
                passed[f] = 1;
                left += g->block;
            }
}
#endif
