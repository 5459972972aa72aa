#ifndef PHI_FILE_ATTITUDE_VELOCITY_FIRST
#define PHI_FILE_ATTITUDE_VELOCITY_FIRST
#include "model.h"

/* rate[3..5] is a velocity. Before it is rotated into body coordinates, it must be the velocity at the position of the
   body. Compute this velocity from the velocity at the origin of space. */
static inline void phi_leave_position(const double element[PHI_ELEMENT], double rate[PHI_RATE])
{
    const double *p = element + 4, *w = rate;
    rate[3] -= p[1] * w[2] - p[2] * w[1];
    rate[4] -= p[2] * w[0] - p[0] * w[2];
    rate[5] -= p[0] * w[1] - p[1] * w[0];
}
#endif
