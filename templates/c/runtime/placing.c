#ifndef PHI_FILE_PLACING
#define PHI_FILE_PLACING
#include <math.h>
#include <string.h>

#include "algebra.c"
#include "model.h"
#include "implicit.c"
#include "level.c"
#include "attitude.c"
#if PHI_RECURRENCES
#define PHI_NEAR_BY 0.125 /* how far the state may be moved, in its own size, for guesses to move with it */

#endif
#if PHI_MONITOR
/* The level of s->x, which was moved from elsewhere; 0, and back there, where it has none. */
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
    PHI_EACH_STAGE /* where s->h is NaN the next step does it again */
        phi_prepare(&s->params, s->gauge, PHI_FRACTION(s->h), PHI_OF(s->coef, stage));
    return 1;
}

#endif
#if PHI_RECURRENCES
/* Guesses move with the state, by as many past values as extrapolation needs: to where a motion through x would have had
   them, which differs from the motion as it was by what moved the state, and by the difference of their slopes. Recurrences
   are of the motion as it was. From far away all begins anew, with the next step. */
static void phi_move_guesses(phi_solver *s, const double from[PHI_DIM])
{
    double distance = 0.0, size = 0.0, before[PHI_DIM], slope[PHI_DIM];
    for (int i = 0; i < PHI_DIM; ++i) {
#if PHI_RELATIVE
        distance = fmax(distance, fabs(s->x[i] / from[i] - 1.0));
        size = 1.0;
#else
        distance += fabs(s->x[i] - from[i]);
        size += fabs(from[i]);
#endif
    }
    if (!(distance <= PHI_NEAR_BY * size)) {
        s->h = (double)NAN;
        return;
    }
#if PHI_TIMED
    phi_vector_field(&s->params, s->t, from, before);
    phi_vector_field(&s->params, s->t, s->x, slope);
#else
    phi_vector_field(&s->params, from, before);
    phi_vector_field(&s->params, s->x, slope);
#endif
#if PHI_MONITOR
    const double rate = phi_monitor(&s->params, s->x), rate_before = phi_monitor(&s->params, from);
    for (int i = 0; i < PHI_DIM; ++i) slope[i] = rate * slope[i] - rate_before * before[i];
#else
    for (int i = 0; i < PHI_DIM; ++i) slope[i] -= before[i];
#endif
#if PHI_COMPOSED
    double since = s->h; /* how long ago the last step began, and then each of its stages */
#endif
    PHI_EACH_STAGE {
        phi_history *history = &PHI_OF(s->history, stage);
#if PHI_COMPOSED
        const double middle = since - 0.5 * PHI_FRACTION(s->h);
        since -= PHI_FRACTION(s->h);
#else
        const double middle = 0.5 * s->h;
#endif
        const int count = history->count < PHI_HISTORY ? history->count : PHI_HISTORY;
        memmove(history->past, history->past + history->count - count, (size_t)count * sizeof history->past[0]);
        for (int k = 0; k < count; ++k)
            for (int i = 0; i < PHI_DIM; ++i)
                history->past[k][i] += (s->x[i] - from[i]) - (middle + (double)(count - 1 - k) * s->h) * slope[i];
        history->count = count;
        history->recurrence_terms = history->use_recurrence = history->slow_steps = 0;
    }
}

#endif
phi_status phi_set_state(phi_solver *s, const double x[PHI_DIM])
{
    if (s == NULL || x == NULL || !phi_finite(x, PHI_DIM)) return PHI_BAD_ARGUMENT;
#if PHI_GUESSED && !PHI_GAUSS || PHI_MONITOR
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
#if PHI_RECURRENCES
    phi_move_guesses(s, from);
#elif PHI_GAUSS
    memset(&s->history, 0, sizeof s->history);
#elif PHI_GUESSED
    /* what guesses begin from moves with the state */
    PHI_EACH_STAGE
        for (int i = 0; i < PHI_DIM; ++i) PHI_OF(s->history, stage).difference[0][i] += s->x[i] - from[i];
#endif
#if PHI_RATE_OF_GAUGE && PHI_MATRICES
    phi_begin_attitude(s, s->attitude);
#elif PHI_RATE_OF_GAUGE
    phi_take_rate(s);
#endif
    return PHI_OK;
}

phi_status phi_kick(phi_solver *s, const double change[PHI_DIM])
{
    if (s == NULL || change == NULL) return PHI_BAD_ARGUMENT;
#if PHI_GUESSED && !PHI_GAUSS || PHI_MONITOR
    double from[PHI_DIM];
    memcpy(from, s->x, sizeof from);
#endif
#if PHI_MONITOR
    double carry[PHI_DIM];
    memcpy(carry, s->carry, sizeof carry);
#endif
    if (!phi_advance(s, change, s->carry)) return PHI_BAD_ARGUMENT;
    PHI_TAKE_LEVEL(s, from)
#if PHI_RECURRENCES
    phi_move_guesses(s, from);
#elif PHI_GAUSS
    memset(&s->history, 0, sizeof s->history);
#elif PHI_GUESSED
    PHI_EACH_STAGE
        for (int i = 0; i < PHI_DIM; ++i) PHI_OF(s->history, stage).difference[0][i] += s->x[i] - from[i];
#endif
#if PHI_RATE_OF_GAUGE && PHI_MATRICES
    phi_begin_attitude(s, s->attitude);
#elif PHI_RATE_OF_GAUGE
    phi_take_rate(s);
#endif
    return PHI_OK;
}
#endif
