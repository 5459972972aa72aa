#ifndef PHI_FILE_ATTITUDE_POSITION
#define PHI_FILE_ATTITUDE_POSITION
#include <string.h>
#include "model.h"

/* Set the last three numbers of a group element to a position in space; NULL is the origin. */
static void phi_take_position(const double position[3], double element[PHI_ELEMENT])
{
    if (position != NULL) memcpy(element + 4, position, 3 * sizeof element[0]);
    else memset(element + 4, 0, 3 * sizeof element[0]);
}

/* Update s->position, which users read. */
static void phi_read_position(phi_solver *s) { memcpy(s->position, s->turned + 4, sizeof s->position); }

/* Write the position to out, after the 4 numbers of the attitude. */
static void phi_put_position(const phi_solver *s, double out[PHI_ELEMENT]) { memcpy(out + 4, s->position, sizeof s->position); }

/* Compute the displacement, the last three numbers of element, by a rotation rate and a velocity that are constant for
   the time t. `speed` is the magnitude of the rotation rate, `scale` is sin(t speed / 2) / speed. */
static inline void phi_uniform_position(const double rate[PHI_RATE], double t, double speed, double scale, double element[PHI_ELEMENT])
{
    const double *w = rate, *v = rate + 3, reach = speed > 0.0 ? 2.0 * (scale * (1.0 + element[0])) : t;
    const double versine = 2.0 * (scale * scale), along = (w[0] * v[0] + w[1] * v[1]) + w[2] * v[2];
    const double rest = speed > 0.0 ? (t - reach) / (speed * speed) * along : 0.0;
    element[4] = reach * v[0] + versine * (w[1] * v[2] - w[2] * v[1]) + rest * w[0];
    element[5] = reach * v[1] + versine * (w[2] * v[0] - w[0] * v[2]) + rest * w[1];
    element[6] = reach * v[2] + versine * (w[0] * v[1] - w[1] * v[0]) + rest * w[2];
}
#endif
