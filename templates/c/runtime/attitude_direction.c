#ifndef PHI_FILE_ATTITUDE_DIRECTION
#define PHI_FILE_ATTITUDE_DIRECTION
#include <math.h>
#include "model.h"
#include "attitude_quaternions.c"

/* Scale the quaternion 1 + factor so that its product with q has length 1. `factor` is overwritten. */
static inline void phi_normalise(const double q[4], double factor[4])
{
    const double factor_excess = (factor[0] * (2.0 + factor[0]) + factor[1] * factor[1])
        + (factor[2] * factor[2] + factor[3] * factor[3]);
    const double excess = factor_excess + phi_excess(q) * (1.0 + factor_excess), length = sqrt(1.0 + excess), per = 1.0 / length;
    factor[0] = per * (factor[0] - excess / (1.0 + length));
    for (int i = 1; i < 4; ++i) factor[i] *= per;
}
#endif
