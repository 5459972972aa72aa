#ifndef PHI_FILE_PREDICTOR_RECURRENCES
#define PHI_FILE_PREDICTOR_RECURRENCES
#include <math.h>
#include <string.h>
#include "model.h"
#include "recurrence.c"
#include "predictor_policy.h"

/* Whether a prediction is near the solution `last`. From elsewhere, the iteration could find an unrelated solution. */
static int phi_near(const double predicted[PHI_DIM], const double last[PHI_DIM])
{
    double distance = 0.0, size = 0.0;
    for (int i = 0; i < PHI_DIM; ++i) {
        distance += fabs(predicted[i] - last[i]);
        size += fabs(last[i]);
    }
    return distance <= PHI_REACH * size;
}

enum {
    PHI_HISTORY = 8, /* largest number of values that the extrapolation uses; more would amplify rounding errors */
    PHI_REPAY = 150, /* cost of fitting a recurrence, in steps; measured */
    PHI_LONG_WAIT = 20000 /* largest number of slow steps until a recurrence is fitted again */
};

/* Predict the next solution from earlier solutions. Returns 0 if no solution is known, or if the prediction is far from
   the last solution. */
static int phi_predict(const phi_history *history, double value[PHI_DIM])
{
    const int last = history->count - 1;
    double odd[PHI_DIM] = { 0.0 }, binomial = -1.0;
    memset(value, 0, PHI_DIM * sizeof value[0]);
    if (history->use_recurrence) {
        for (int k = 0; k < history->recurrence_terms; k += 2)
            for (int i = 0; i < PHI_DIM; ++i) {
                value[i] += history->weight[k][i][0] * history->past[last - k][i];
                odd[i] += history->weight[k + 1][i][0] * history->past[last - 1 - k][i];
            }
        for (int i = 0; i < PHI_DIM; ++i) value[i] += odd[i];
    } else {
        for (int k = 0; k < history->extrapolation_order && k <= last; ++k) {
            binomial *= -(double)(history->extrapolation_order - k) / (k + 1);
            for (int i = 0; i < PHI_DIM; ++i) value[i] += binomial * history->past[last - k][i];
        }
    }
    return last >= 0 && phi_near(value, history->past[last]);
}

/* After a step that took several iterations, select the predictor that would have predicted its solution `value` best.
   */
static void phi_judge(phi_history *history, const double value[PHI_DIM])
{
    double row[PHI_HISTORY + 1][PHI_DIM], predicted[PHI_DIM], least = HUGE_VAL, fitted = HUGE_VAL;
    const int rows = history->count < PHI_HISTORY ? history->count : PHI_HISTORY;
    memcpy(row[0], value, sizeof row[0]);
    for (int k = 0; k < rows; ++k) memcpy(row[k + 1], history->past[history->count - 1 - k], sizeof row[0]);
    for (int order = 1; order <= rows; ++order) { /* row[0] becomes the backward difference of this order */
        double size = 0.0;
        for (int k = 0; k <= rows - order; ++k)
            for (int i = 0; i < PHI_DIM; ++i) row[k][i] -= row[k + 1][i];
        for (int i = 0; i < PHI_DIM; ++i) size += fabs(row[0][i]);
        if (size < least) {
            least = size;
            history->extrapolation_order = order;
        }
    }
    history->use_recurrence = history->recurrence_terms > 0;
    if (history->use_recurrence && phi_predict(history, predicted)) {
        fitted = 0.0;
        for (int i = 0; i < PHI_DIM; ++i) fitted += fabs(value[i] - predicted[i]);
    }
    history->use_recurrence = history->recurrence_terms > 0 && fitted <= least;
    if (history->extrapolation_order == 0) history->extrapolation_order = 1;
}

/* Drop all but the last PHI_REMEMBERED solutions if there is no room for the given number of further ones. */
static void phi_make_room(phi_history *history, int values)
{
    if (history->count + values <= PHI_STORED_VALUES) return;
    memmove(history->past, history->past + history->count - PHI_REMEMBERED, PHI_REMEMBERED * sizeof history->past[0]);
    history->count = PHI_REMEMBERED;
}

/* Fit the recurrence to the stored solutions. The number of slow steps until the next fit grows with every fit. Returns
   whether the recurrence predicts well. */
static int phi_fit(phi_history *history)
{
    int fitted = 1;
    history->recurrence_terms = 0;
    for (int i = 0; i < PHI_DIM && fitted; ++i) {
        const int terms = phi_train(history, i);
        fitted = terms > 0;
        if (terms > history->recurrence_terms) history->recurrence_terms = terms;
    }
    if (!fitted) history->recurrence_terms = 0;
    history->use_recurrence = fitted;
    ++history->fits;
    history->slow_steps = 0;
    history->slow_steps_allowed = history->slow_steps_allowed < PHI_LONG_WAIT / 2
        ? 2 * history->slow_steps_allowed + PHI_REPAY : PHI_LONG_WAIT;
    return fitted;
}

/* Update the predictor with a solution that took this number of iterations; 1 means that the prediction was good. */
static void phi_remember(phi_history *history, const double value[PHI_DIM], int iterations)
{
    if (iterations > 1) phi_judge(history, value);
    phi_make_room(history, 1);
    memcpy(history->past[history->count++], value, PHI_DIM * sizeof value[0]);
    history->slow_steps = iterations > 1 ? history->slow_steps + 1 : 0;
    if (history->slow_steps > history->slow_steps_allowed && history->count >= PHI_REMEMBERED) phi_fit(history);
}
#endif
