#ifndef PHI_FILE_LATTICE_WAVES
#define PHI_FILE_LATTICE_WAVES
#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "sweeps.h"

/* ---- Wavefront (temporal) blocking ---- */
/* If the fields exceed the caches, several flows pass over the lattice together, slice by slice. Each flow is PHI_SPAN slices
   behind the flow before it, so that a slice is loaded once for all of them. Each thread has its own range of slices. At the
   ends of the range, flow k first leaves out k PHI_SPAN slices, which are updated when all threads have reached their ends.
   Each flow reads the same values as in separate passes, so the bits are the same. */
enum { PHI_DEEPEST = 16, PHI_CACHE = 1 << 21 }; /* largest number of flows in a block; bytes of cache for the slices of all these flows */

#if PHI_ONE_ROW
/* Number of slices: the segments of the row. */
static size_t phi_slices(const phi_solver *s) { return phi_units(s); }
#else
/* Number of slices: all rows with one index of the first axis form a slice. */
static size_t phi_slices(const phi_solver *s) { return s->sizes[0]; }
#endif

/* Number of flows that pass over the lattice together; 1 if blocking does not pay. */
static size_t phi_depth(const phi_solver *s)
{
    const size_t slices = phi_slices(s), bytes = PHI_DOUBLES * PHI_ARRAYS * sizeof(double);
    const size_t held = PHI_CACHE / (bytes / slices) / PHI_SPAN, room = slices / PHI_THREADS / (2 * PHI_SPAN);
    const size_t depth = held < room ? held : room;
#if PHI_TANGENT
    if (s->vectors > 0) return 1;
#endif
    if (bytes <= PHI_CACHE || depth < 2) return 1;
    return depth < PHI_DEEPEST ? depth : (size_t)PHI_DEEPEST;
}

static void phi_make_slices(const phi_solver *s, const phi_flow *flow, size_t from, size_t to)
{
#if !PHI_ONE_ROW
    const size_t rows = s->rows / s->sizes[0];
    from *= rows;
    to *= rows;
#endif
#if PHI_RECOMPUTED
    if (flow->go > 0) phi_reverse_flow(s, flow, from, to);
    else phi_sweep_rows(s, flow->part, flow->coef PHI_AND_FULL_RANGE(s->full_range > 0), from, to);
#else
    phi_sweep_rows(s, flow->part, flow->coef PHI_AND_FULL_RANGE(s->full_range > 0), from, to);
#endif
}

/* Apply some flows as one block. */
static void phi_make_wave(const phi_solver *s, const phi_flow *flows, size_t count)
{
    size_t from;
    const size_t slices = phi_slices(s), to = phi_share(slices, &from), next = to == slices ? 0 : to;
    for (size_t front = from; front < to; ++front)
        for (size_t k = 0; k < count && front >= from + 2 * k * PHI_SPAN; ++k)
            phi_make_slices(s, flows + k, front - k * PHI_SPAN, front - k * PHI_SPAN + 1);
    phi_wait();
    for (size_t k = 1; k < count; ++k) {
        phi_make_slices(s, flows + k, to - k * PHI_SPAN, to);
        phi_make_slices(s, flows + k, next, next + k * PHI_SPAN);
    }
    phi_wait();
}

/* Apply the flows of some steps except for the very last flow. Between two steps, the last flow is merged with the first. */
static void phi_make_waves(const phi_solver *s, size_t steps)
{
    const size_t each = PHI_FLOWS - 1, depth = phi_depth(s);
    phi_flow flows[PHI_DEEPEST];
    for (size_t done = 0; done < steps * each;) {
        size_t count = 0;
        for (; count < depth && done < steps * each; ++count, ++done) {
            const int number = (int)(done % each), joined = number == 0 && (done > 0 || s->open);
            phi_set_flow(s, s->steps + done / each, joined ? PHI_FLOWS : number, flows + count);
        }
        if (count > 1) phi_make_wave(s, flows, count);
        else phi_sweep_part(s, flows->part, flows->coef PHI_AND_FULL_RANGE(s->full_range > 0));
    }
}
#endif
