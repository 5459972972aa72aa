#ifndef PHI_FILE_PLACING_LEVEL
#define PHI_FILE_PLACING_LEVEL
#include <math.h>
#include <string.h>
#include "model.h"
#include "algebra.c"
#include "level.c"

/* Set the energy level e to -H of the new state s->x. If the new state is not admissible, restore the former state and
   return 0. */
static int phi_take_level(phi_solver *s, const double from[PHI_DIM], const double carry[PHI_DIM])
{
    double level[PHI_GAUGES];
    const double rate = phi_monitor(&s->params, s->x);
    phi_choose_gauge(&s->params, s->x, level);
    if (!isfinite(level[0]) || !isfinite(rate) || !(rate > 0.0)) {
        memcpy(s->x, from, sizeof s->x);
        memcpy(s->carry, carry, sizeof s->carry);
        return 0;
    }
    memcpy(s->gauge, level, sizeof level);
    /* if s->h is NaN, the next step computes the coefficients again */
    PHI_EACH_STAGE phi_prepare(&s->params, s->gauge, PHI_FRACTION(s->h), PHI_OF(s->coef, stage));
    return 1;
}
#endif
