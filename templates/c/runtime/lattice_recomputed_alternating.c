#ifndef PHI_FILE_LATTICE_RECOMPUTED_ALTERNATING
#define PHI_FILE_LATTICE_RECOMPUTED_ALTERNATING
#include "lattice.h"
#include "model.h"

/* Number of a flow among all flows of a run; a merged flow belongs to the later step. */
static size_t phi_number_of(size_t step, int number) { return step * PHI_OWN_FLOWS + (size_t)(number % PHI_FLOWS); }

/* Arrays for the contributions of a flow to cotangents of other sites. There are two sets, which flows use alternately. */
static double *const *phi_handed_by(const phi_transpose *g, size_t flow) { return g->handed + flow % 2 * (PHI_HANDED / 2); }

/* Set the contributions of a flow to cotangents of other sites to 0, before a reverse pass. */
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

/* After a reverse pass: add the contributions of the flow that was processed last to the cotangents of other sites. */
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

/* Pull cotangents back through a flow for row segments, and invert the flow. */
#endif
