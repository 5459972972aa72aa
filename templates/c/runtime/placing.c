#ifndef PHI_FILE_PLACING
#define PHI_FILE_PLACING
#include <math.h>
#include <string.h>

#include "model.h"
#if PHI_GUESSED
#include "implicit.c"
#endif
#if PHI_MONITOR
#include "level.c"
#endif
#if PHI_ATTITUDE
#include "attitude.c"
#endif
/* ---- Between steps ---- */
#if PHI_GUESSED
#define PHI_NEAR_BY 0.125 /* how far the state may be moved, in its own size, for guesses to move with it */

/* Guesses move with the state, by as many past values as extrapolation needs; recurrences are of the motion as it was. From
   far away all begins anew, with the next step. */
static void phi_move_guesses(phi_solver *s, const double to[PHI_DIM])
{
    double distance = 0.0, size = 0.0;
    for (int i = 0; i < PHI_DIM; ++i) {
#if PHI_RELATIVE
        distance = fmax(distance, fabs(to[i] / s->x[i] - 1.0));
        size = 1.0;
#else
        distance += fabs(to[i] - s->x[i]);
        size += fabs(s->x[i]);
#endif
    }
    if (!(distance <= PHI_NEAR_BY * size)) {
        s->h = (double)NAN;
        return;
    }
    for (int stage = 0; stage < PHI_STAGES; ++stage) {
        phi_history *history = &s->history[stage];
#if PHI_RECURRENCES
        const int count = history->count < PHI_HISTORY ? history->count : PHI_HISTORY;
        memmove(history->past, history->past + history->count - count, (size_t)count * sizeof history->past[0]);
        for (int k = 0; k < count; ++k)
            for (int i = 0; i < PHI_DIM; ++i) history->past[k][i] += to[i] - s->x[i];
        history->count = count;
        history->recurrence_terms = history->use_recurrence = history->slow_steps = 0;
#else
        for (int i = 0; i < PHI_DIM; ++i) history->difference[0][i] += to[i] - s->x[i];
#endif
    }
}

#endif
/* Stand at x + carry from now on. */
static phi_status phi_place(phi_solver *s, const double x[PHI_DIM], const double carry[PHI_DIM])
{
    for (int i = 0; i < PHI_DIM; ++i)
        if (!isfinite(x[i])) return PHI_BAD_ARGUMENT;
#if PHI_MONITOR
    double level[PHI_GAUGES];
    const double rate = phi_monitor(&s->params, x);
    phi_choose_gauge(&s->params, x, level);
    if (!isfinite(level[0]) || !isfinite(rate) || !(rate > 0.0)) return PHI_BAD_ARGUMENT;
    memcpy(s->gauge, level, sizeof level);
    for (int stage = 0; stage < PHI_STAGES; ++stage) /* where s->h is NaN the next step does it again */
        phi_prepare(&s->params, s->gauge, phi_fractions[stage] * s->h, s->coef[stage]);
#endif
#if PHI_GUESSED
    phi_move_guesses(s, x);
#endif
    memcpy(s->x, x, sizeof s->x);
    memcpy(s->carry, carry, sizeof s->carry);
#if PHI_RATE_OF_GAUGE
#if PHI_POSITION
    phi_set_attitude(s, s->attitude, s->position); /* the gauge turns the body at another rate from here on */
#else
    phi_set_attitude(s, s->attitude); /* the gauge turns the body at another rate from here on */
#endif
#endif
    return PHI_OK;
}

phi_status phi_set_state(phi_solver *s, const double x[PHI_DIM])
{
    double to[PHI_DIM], carry[PHI_DIM] = { 0.0 };
    if (s == NULL || x == NULL) return PHI_BAD_ARGUMENT;
    memcpy(to, x, sizeof to); /* which may be a part of *s */
    return phi_place(s, to, carry);
}

phi_status phi_kick(phi_solver *s, const double change[PHI_DIM])
{
    double to[PHI_DIM], carry[PHI_DIM];
    if (s == NULL || change == NULL) return PHI_BAD_ARGUMENT;
    for (int i = 0; i < PHI_DIM; ++i) {
        const double sum = s->x[i] + change[i], added = sum - s->x[i];
        const double lost = ((s->x[i] - (sum - added)) + (change[i] - added)) + s->carry[i];
        to[i] = sum + lost;
        carry[i] = lost - (to[i] - sum);
    }
    return phi_place(s, to, carry);
}
#endif
