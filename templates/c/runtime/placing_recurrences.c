#ifndef PHI_FILE_PLACING_RECURRENCES
#define PHI_FILE_PLACING_RECURRENCES
#include <math.h>
#include <string.h>
#include "algebra.c"
#include "implicit.c"
#include "model.h"

#define PHI_NEAR_BY 0.125 /* largest relative change of the state after which predictors are shifted rather than cleared */

/* Adapt the predictors to a change of the state by d. Let f be the change of the vector field. A past solution at the
   time t before the new state is shifted by d - t f: to first order, it then lies on the motion through the new state.
   Recurrences are dropped, since they were fitted to the former motion. After a large change, the next step clears the
   predictors. */
static void phi_shift_predictors(phi_solver *s, const double from[PHI_DIM])
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
    double since = s->h; /* time since the start of a stage in the last step; at first of stage 0 */
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
