#ifndef PHI_FILE_ATTITUDE_LENGTH
#define PHI_FILE_ATTITUDE_LENGTH
#include "model.h"
#include "attitude_quaternions.c"

/* Scale the quaternion 1 + factor so that its product with q has a length nearer to 1, by one Newton iteration.
   `factor` is overwritten. */
static inline void phi_normalise(const double q[4], double factor[4])
{
    const double half = 0.5 * phi_excess(q);
    factor[0] -= half + half * factor[0];
    for (int i = 1; i < 4; ++i) factor[i] -= half * factor[i];
}
#endif
