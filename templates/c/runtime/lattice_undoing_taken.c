#ifndef PHI_FILE_LATTICE_UNDOING_TAKEN
#define PHI_FILE_LATTICE_UNDOING_TAKEN
#include "lattice.h"
#include "model.h"

/* The number among all flows of that flow of the step after so many: those that are joined are that of the step after them. */
static size_t phi_number_of(size_t step, int number) { return step * PHI_OWN_FLOWS + (size_t)(number % PHI_FLOWS); }

/* What flows hand lies in the arrays of every second flow by turns, by their number among all. */
static double *const *phi_handed_by(const phi_transpose *g, size_t flow) { return g->handed + flow % 2 * (PHI_HANDED / 2); }

/* Before some flows are gone back through: the flow after them, of that number, has handed nothing. */
static void phi_hand_nothing(const phi_solver *s, const phi_transpose *g, size_t flow)
{
    size_t first, end = phi_share(phi_units(s), &first);
    for (size_t unit = first; unit < end; ++unit) {
        const phi_row row = phi_piece_of(s, unit);
        for (int k = 0; k < PHI_HANDED / 2; ++k) {
            double *restrict handed = PHI_HERE(phi_handed_by(g, flow)[k]);
            for (ptrdiff_t i = row.from; i < row.to; ++i) handed[i] = 0.0;
            PHI_COPY_ENDS(handed, s->length, row.from, row.to)
        }
    }
    phi_wait();
}

/* After them: what the last one, of that number, has handed. */
static void phi_hand_last(const phi_solver *s, const phi_transpose *g, size_t flow, double *const *bar)
{
#if PHI_HANDS
    size_t first, end = phi_share(phi_units(s), &first);
    phi_hand_rows(s, phi_flow_parts[0], s->x, bar, phi_handed_by(g, flow), first, end);
    phi_wait();
#else
    (void)s, (void)g, (void)flow, (void)bar;
#endif
}

/* Pull cotangents back through a flow, and undo it, at pieces of rows. */
#endif
