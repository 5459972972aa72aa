#ifndef PHI_FILE_PLACING
#define PHI_FILE_PLACING
#include <math.h>
#include <string.h>

#include "algebra.c"
#include "model.h"
#include "implicit.c"
#include "level.c"
#include "attitude.c"

#include "placing_level.c"

#include "placing_recurrences.c"

phi_status phi_set_state(phi_solver *s, const double x[PHI_DIM])
{
    if (s == NULL || x == NULL || !phi_finite(x, PHI_DIM)) return PHI_BAD_ARGUMENT;
#if PHI_PREDICTED && !PHI_GAUSS || PHI_MONITOR
    double from[PHI_DIM];
    memcpy(from, s->x, sizeof from);
#endif
#if PHI_MONITOR
    double carry[PHI_DIM];
    memcpy(carry, s->carry, sizeof carry);
#endif
    memmove(s->x, x, sizeof s->x); /* x may be a part of *s */
    memset(s->carry, 0, sizeof s->carry);
    PHI_TAKE_LEVEL(s, from)
    PHI_SHIFT_PREDICTORS(s, from)
#if PHI_GAUSS
    memset(&s->history, 0, sizeof s->history);
#endif
    phi_renew_rate(s);
    return PHI_OK;
}

phi_status phi_kick(phi_solver *s, const double change[PHI_DIM])
{
    if (s == NULL || change == NULL) return PHI_BAD_ARGUMENT;
#if PHI_PREDICTED && !PHI_GAUSS || PHI_MONITOR
    double from[PHI_DIM];
    memcpy(from, s->x, sizeof from);
#endif
#if PHI_MONITOR
    double carry[PHI_DIM];
    memcpy(carry, s->carry, sizeof carry);
#endif
    if (!phi_advance(s, change, s->carry)) return PHI_BAD_ARGUMENT;
    PHI_TAKE_LEVEL(s, from)
    PHI_SHIFT_PREDICTORS(s, from)
#if PHI_GAUSS
    s->history.kicked = 1; /* increments of the last step still predict those of the next */
#endif
    phi_renew_rate(s);
    return PHI_OK;
}
#endif
