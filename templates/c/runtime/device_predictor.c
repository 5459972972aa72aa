#ifndef PHI_FILE_DEVICE_PREDICTOR
#define PHI_FILE_DEVICE_PREDICTOR
#include "model.h"
#include "predictor_policy.h"

/* Where shared memory holds component i of difference k, counted from the first number of a work item. */
static int phi_place_of(int k, int i) { return (k * PHI_DIM + i) * PHI_GROUP; }


/* The loops below have constant bounds, and selections in place of branches, so that a compiler can keep all values in
   registers. */

/* Predict the next solution: the last one plus backward differences. Returns 0 if no solution is known, or if the
   prediction is so far from the last solution that the iteration could find an unrelated one. */
static int phi_predict(const phi_history *history, double value[PHI_DIM])
{
    double distance = 0.0, size = 0.0;
    PHI_UNROLL
    for (int i = 0; i < PHI_DIM; ++i) {
        value[i] = 0.0;
        PHI_UNROLL
        for (int k = 0; k < PHI_DIFFERENCES; ++k) value[i] = k < history->order ? value[i] + history->difference[phi_place_of(k, i)] : value[i];
        distance += fabs(value[i] - history->difference[phi_place_of(0, i)]);
        size += fabs(history->difference[phi_place_of(0, i)]);
    }
    return history->order > 0 && distance <= PHI_REACH * size;
}

/* Update the predictor with a solution. The error of the prediction of order k is the k-th difference; the order with
   the smallest error is used next. */
static void phi_remember(phi_history *history, const double value[PHI_DIM])
{
    double least = HUGE_VAL, next[PHI_DIM];
    phi_copy(next, value, PHI_DIM);
    PHI_UNROLL
    for (int k = 0; k < PHI_DIFFERENCES; ++k) {
        const int known = k <= history->count;
        double size = 0.0;
        PHI_UNROLL
        for (int i = 0; i < PHI_DIM; ++i) {
            const double last = history->difference[phi_place_of(k, i)];
            history->difference[phi_place_of(k, i)] = known ? next[i] : last;
            size += fabs(next[i]);
            next[i] -= last;
        }
        const int better = known && k > 0 && size < least;
        least = better ? size : least;
        history->order = better ? k : history->order;
    }
    history->order = history->count == 0 ? 1 : history->order;
    history->count += history->count < PHI_DIFFERENCES;
}
#endif
