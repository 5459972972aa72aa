#ifndef PHI_FILE_RECURRENCE
#define PHI_FILE_RECURRENCE
#include <math.h>
#include <string.h>

#include "model.h"

/* ---- Recurrences fitted to the last values ---- */
/* A fit stops adding values once the residual is below this, relative to the largest value. */
#define PHI_ENOUGH 3e-12

/* Weight of the regularisation in the least-squares fit, relative to the largest value: the level of rounding. */
#define PHI_RIDGE 1e-15

/* Largest accepted error of a recurrence for values to which it was not fitted, relative to the largest value. If the error
   is larger, the motion is chaotic or the step long, and other predictors are as good. */
#define PHI_MAX_FIT_ERROR 1e-7

enum { PHI_ROWS = (int)PHI_REMEMBERED - PHI_WINDOW - PHI_AHEAD - PHI_CHECKS + 1 }; /* number of equations of the least-squares problem */

/* Make eight columns orthogonal to one column, by subtracting multiples of it; r receives the factors. If the column is one
   of the eight, columns up to it are unchanged, and *inverse becomes 1 / (its squared norm). The number of rows is even. */
static void phi_project(int rows, double (*one)[8], int column, double *inverse, double (*eight)[8], double r[8])
{
    double even[8] = { 0.0 }, odd[8] = { 0.0 };
    for (int i = 0; i < rows; i += 2) {
        const double entry = one[i][column], next = one[i + 1][column];
        for (int l = 0; l < 8; ++l) even[l] += entry * eight[i][l];
        for (int l = 0; l < 8; ++l) odd[l] += next * eight[i + 1][l];
    }
    for (int l = 0; l < 8; ++l) even[l] += odd[l];
    if (one == eight) {
        *inverse = even[column] > 0.0 ? 1.0 / even[column] : 0.0;
        memset(even, 0, ((size_t)column + 1) * sizeof even[0]);
    }
    for (int l = 0; l < 8; ++l) r[l] = even[l] *= *inverse;
    for (int i = 0; i < rows; ++i) {
        const double entry = one[i][column];
        for (int l = 0; l < 8; ++l) eight[i][l] -= entry * even[l];
    }
}

/* Largest error with which the recurrences predict the last values in the array. The fit does not use these values. */
static double phi_missed(const double *value, double (*weight)[8])
{
    enum { AHEAD = PHI_AHEAD, WINDOW = PHI_WINDOW, CHECKS = PHI_CHECKS };
    double most = 0.0;
    for (int i = 0; i < CHECKS; ++i) {
        double predicted[8] = { 0.0 };
        for (int k = 0; k < WINDOW; ++k)
            for (int l = 0; l < 8; ++l) predicted[l] += weight[k][l] * value[i + WINDOW - 1 - k];
        for (int l = 0; l < AHEAD; ++l) most = fmax(most, fabs(predicted[l] - value[i + WINDOW + l]));
    }
    return most;
}

/* Fit the recurrences value[m + l] = sum of weight[k][component][l] * value[m - 1 - k], l = 0 ... PHI_AHEAD - 1, to the
   history of a component, by least squares with Tikhonov regularisation (modified Gram-Schmidt). Columns are added
   eight at a time, until the residuals are negligible. Returns the number of past values used, or 0 if the recurrences
   do not predict the last values, which were left out of the fit. */
static int phi_train(phi_history *history, int component)
{
    enum { AHEAD = PHI_AHEAD, WINDOW = PHI_WINDOW, ROWS = PHI_ROWS };
    double q[WINDOW / 8][ROWS + WINDOW][8], r[WINDOW / 8][WINDOW][8], inverse[WINDOW]; /* the first index of q and of r counts groups of eight columns */
    double right[ROWS + WINDOW][8], weight[WINDOW][8], value[PHI_REMEMBERED], largest = 0.0, left = HUGE_VAL;
    int terms = 0;
    memset(q, 0, sizeof q);
    memset(right, 0, sizeof right);
    memset(weight, 0, sizeof weight);
    for (int i = 0; i < PHI_REMEMBERED; ++i) {
        value[i] = history->past[history->count - PHI_REMEMBERED + i][component];
        if (fabs(value[i]) > largest) largest = fabs(value[i]);
    }
    for (int i = 0; i < ROWS; ++i)
        for (int l = 0; l < AHEAD; ++l) right[i][l] = value[i + WINDOW + l];
    while (terms < WINDOW && left > PHI_ENOUGH * largest) {
        const int part = terms / 8, rows = ROWS + terms + 8; /* the rows after the first `rows` belong to the regularisation of later columns, and are 0 here */
        for (int i = 0; i < ROWS; ++i)
            for (int l = 0; l < 8; ++l) q[part][i][l] = value[i + WINDOW - 1 - terms - l];
        for (int l = 0; l < 8; ++l) q[part][ROWS + terms + l][l] = PHI_RIDGE * largest;
        for (int k = 0; k < terms; ++k) phi_project(rows, q[k / 8], k % 8, &inverse[k], q[part], r[part][k]);
        for (int l = 0; l < 8; ++l, ++terms) {
            phi_project(rows, q[part], l, &inverse[terms], q[part], r[part][terms]);
            phi_project(rows, q[part], l, &inverse[terms], right, weight[terms]);
        }
        double sum[8] = { 0.0 };
        for (int i = 0; i < ROWS; ++i)
            for (int l = 0; l < 8; ++l) sum[l] += fabs(right[i][l]);
        left = 0.0;
        for (int l = 0; l < 8; ++l) left += sum[l] / (double)ROWS;
    }
    for (int k = terms - 1; k >= 0; --k)
        for (int j = k + 1; j < terms; ++j)
            for (int l = 0; l < 8; ++l) weight[k][l] -= r[j / 8][k][j % 8] * weight[j][l];
    for (int k = 0; k < WINDOW; ++k) memcpy(history->weight[k][component], weight[k], AHEAD * sizeof(double));
    return phi_missed(value + ROWS, weight) <= PHI_MAX_FIT_ERROR * largest ? terms : 0;
}
#endif
