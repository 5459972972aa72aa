#ifndef PHI_FILE_ATTITUDE_GAUGE
#define PHI_FILE_ATTITUDE_GAUGE
#include "model.h"
#include "attitude_matrices.c"
#include "attitude_quaternions.c"

/* ---- Gauge rotation: subtracting multiples of Casimirs from H adds a uniform rotation of the body, with a constant rate
   in the frame where the momenta are constant ---- */
/* Multiply s->turned by 1 + aside, the gauge rotation of a step, and add its change to element and to carry. NULL for no
   rotation. */
static inline void phi_add_aside(phi_solver *s, const double *aside, double element[PHI_ELEMENT], double carry[PHI_ELEMENT])
{
    double change[PHI_ELEMENT];
    if (aside == NULL) return;
    PHI_ADDED_ASIDE(s->turned, aside, change);
    for (int i = 0; i < PHI_ELEMENT; ++i) element[i] += change[i];
    for (int i = 0; i < PHI_ELEMENT; ++i) carry[i] += change[i];
}

/* Compute the gauge rotation of one step and, if steps are solved in blocks, of a block of steps. */
static void phi_set_aside(phi_solver *s)
{
    phi_uniform(s->rate, s->h, s->aside);
    PHI_SET_ASIDE_OF_BLOCK(s)
}

/* Compute the rate of the gauge rotation, after the state or the attitude has been set. */
static void phi_take_rate(phi_solver *s)
{
    phi_rate(&s->params PHI_AND_GAUGE(s->gauge), s->x, s->rate);
    phi_carry_rate(s->turned, s->rate);
    phi_set_aside(s);
}
#endif
