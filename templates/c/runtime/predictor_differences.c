#ifndef PHI_FILE_PREDICTOR_DIFFERENCES
#define PHI_FILE_PREDICTOR_DIFFERENCES
#include <math.h>
#include <string.h>
#include "model.h"
#include "predictor_policy.h"

/* Predict the next solution: the last one plus backward differences. Returns 0 if no solution is known, or if the
   prediction is so far from the last solution that the iteration could find an unrelated one. */
static int phi_predict(const phi_history *history, double value[PHI_DIM])
{
    double distance = 0.0, size = 0.0;
    for (int i = 0; i < PHI_DIM; ++i) {
        value[i] = 0.0;
        for (int k = 0; k < history->order; ++k) value[i] += history->difference[k][i];
        distance += fabs(value[i] - history->difference[0][i]);
        size += fabs(history->difference[0][i]);
    }
    return history->order > 0 && distance <= PHI_REACH * size;
}

/* Update the predictor. difference[k] becomes the solution minus the sum of the first k old differences. */
static void phi_remember(phi_history *history, const double value[PHI_DIM])
{
    double least = HUGE_VAL, next[PHI_DIM];
    memcpy(next, value, sizeof next);
    for (int k = 0; k <= history->count && k < PHI_DIFFERENCES; ++k) {
        double size = 0.0;
        for (int i = 0; i < PHI_DIM; ++i) {
            const double last = history->difference[k][i];
            history->difference[k][i] = next[i];
            size += fabs(next[i]);
            next[i] -= last;
        }
        if (k > 0 && size < least) {
            least = size;
            history->order = k;
        }
    }
    if (history->count == 0) history->order = 1;
    if (history->count < PHI_DIFFERENCES) ++history->count;
}
#endif
