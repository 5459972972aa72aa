#ifndef PHI_FILE_LATTICE_TAPE_RECOMPUTED
#define PHI_FILE_LATTICE_TAPE_RECOMPUTED
#include "lattice.h"
#include "model.h"

/* The reverse pass recomputes states by the inverse flows. The tape holds a state for each leg, a group of consecutive steps,
   at its start, so rounding errors do not pass from leg to leg. If a recomputed state differs too much, for instance since
   fields grow fast, the pass is repeated with legs of one step. If that fails too, as with strong damping, the state before
   each flow is recomputed from the start of its step. Legs are counted from the start of the run, so results do not depend
   on the division into segments. */
#define PHI_UNLIKE (450.0 * DBL_EPSILON) /* largest accepted difference from the stored state, relative to the largest value of all fields; 1e-13 in double precision */

/* Number of legs into which `steps` steps are divided; a leg has `leg` steps, the last one may have fewer. */
static size_t phi_legs(size_t steps, size_t leg) { return steps / leg + (steps % leg > 0); }

/* Number of bytes on the tape for one leg. */
static size_t phi_leg_size(const phi_solver *s) { return PHI_DIM * phi_block(s->rows, s->width) * sizeof(double); }

size_t phi_trail_size(const phi_solver *s, size_t steps)
{
    const size_t of_leg = phi_leg_size(s), legs = phi_legs(steps, PHI_STRETCH);
    if (legs > SIZE_MAX / 8 / of_leg) return 0;
    return phi_always(s) * sizeof(double) + legs * of_leg + phi_state_size(s) + 64;
}
#endif
