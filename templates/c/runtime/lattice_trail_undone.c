#ifndef PHI_FILE_LATTICE_TRAIL_UNDONE
#define PHI_FILE_LATTICE_TRAIL_UNDONE
#include "lattice.h"
#include "model.h"

/* Sweeps are undone on the way back, leg by leg: the state that a leg begins with is kept, so what rounding adds is left behind there.
   Where it has added much, as where fields grow fast, all is done once more with legs of one step, and where that does not do, as
   where they are damped away, from the beginning of a step for each of its flows. Legs are counted from
   where the run began: segments change no bit. */
#define PHI_UNLIKE (450.0 * DBL_EPSILON) /* of the largest value of all fields, 1e-13 in double precision */

/* The legs that steps from the beginning of one take. */
static size_t phi_legs(size_t steps, size_t leg) { return steps / leg + (steps % leg > 0); }

/* The bytes that a leg keeps. */
static size_t phi_leg_size(const phi_solver *s) { return PHI_DIM * phi_block(s->rows, s->width) * sizeof(double); }

size_t phi_trail_size(const phi_solver *s, size_t steps)
{
    const size_t of_leg = phi_leg_size(s), legs = phi_legs(steps, PHI_STRETCH);
    if (legs > SIZE_MAX / 8 / of_leg) return 0;
    return phi_always(s) * sizeof(double) + legs * of_leg + phi_state_size(s) + 64;
}
#endif
