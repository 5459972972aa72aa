#ifndef PHI_FILE_ALGEBRA
#define PHI_FILE_ALGEBRA
#include <math.h>
#include <string.h>

#include "model.h"

PHI_CHAPTER_OF_ALGEBRA
#include "finite.c"
#include "device_finite.c"

#include "advance.c"
#include "advance_gauss.c"

#include "elapsed.c"

/* Add `change` to coordinate i within a step. `displacement` is the sum of the compensation term and of the changes so
   far; x is the rounded sum `start` + `displacement`. */
static inline void phi_add(double x[PHI_DIM], double displacement[PHI_DIM], const double start[PHI_DIM], int i, double change)
{
    displacement[i] += change;
    x[i] = start[i] + displacement[i];
}

/* At the end of a step, add `displacement` to x in compensated arithmetic. */
static void phi_settle(double x[PHI_DIM], double carry[PHI_DIM], const double displacement[PHI_DIM])
{
    for (int i = 0; i < PHI_DIM; ++i) {
        const double sum = x[i] + displacement[i], added = sum - x[i];
        carry[i] = (x[i] - (sum - added)) + (displacement[i] - added);
        x[i] = sum;
    }
}

#if PHI_IMPLICIT
#if PHI_UNROLLED || PHI_BLOCKS || PHI_TRACED
#define PHI_LARGEST_RECIPROCAL 1e3 /* a pivot with a larger reciprocal is far from 1 */

#endif
#include "device_linear.c"
#if !PHI_DEVICE
/* Solve `matrix` * x = `side` by elimination with pivoting; `side` receives x. Returns 0 if singular. */
#if PHI_UNROLLED
static int phi_solve_pivoting(double matrix[PHI_DIM * PHI_DIM], double side[PHI_DIM])
#else
static int phi_solve(double matrix[PHI_DIM * PHI_DIM], double side[PHI_DIM])
#endif
{
    for (int k = 0; k < PHI_DIM; ++k) {
        int best = k;
        for (int i = k + 1; i < PHI_DIM; ++i)
            if (fabs(matrix[i * PHI_DIM + k]) > fabs(matrix[best * PHI_DIM + k])) best = i;
        const double pivot = matrix[best * PHI_DIM + k], last = side[k];
        if (!(fabs(pivot) > 0.0)) return 0;
        for (int j = k; j < PHI_DIM && best != k; ++j) {
            const double swap = matrix[k * PHI_DIM + j];
            matrix[k * PHI_DIM + j] = matrix[best * PHI_DIM + j];
            matrix[best * PHI_DIM + j] = swap;
        }
        side[k] = side[best];
        side[best] = last;
        for (int i = k + 1; i < PHI_DIM; ++i) {
            const double factor = matrix[i * PHI_DIM + k] / pivot;
            for (int j = k + 1; j < PHI_DIM; ++j) matrix[i * PHI_DIM + j] -= factor * matrix[k * PHI_DIM + j];
            side[i] -= factor * side[k];
        }
    }
    for (int i = PHI_DIM - 1; i >= 0; --i) {
        for (int j = i + 1; j < PHI_DIM; ++j) side[i] -= matrix[i * PHI_DIM + j] * side[j];
        side[i] /= matrix[i * PHI_DIM + i];
    }
    return 1;
}

#endif
#if PHI_UNROLLED
/* Solve `matrix` * x = `side`; `side` receives x, and `matrix` is overwritten. The matrix is I + O(h), so elimination
   needs no pivoting unless a pivot is far from 1. Returns 0 if the matrix is singular. */
static int phi_solve(double matrix[PHI_DIM * PHI_DIM], double side[PHI_DIM])
{
    double solution[PHI_DIM], reciprocal[PHI_DIM], largest = 0.0;
    phi_eliminate(matrix, side, solution, reciprocal);
    for (int i = 0; i < PHI_DIM; ++i)
        if (!(fabs(reciprocal[i]) <= largest)) largest = fabs(reciprocal[i]);
    if (!(largest < PHI_LARGEST_RECIPROCAL)) return phi_solve_pivoting(matrix, side);
    memcpy(side, solution, sizeof solution);
    return 1;
}

#endif
#if PHI_NEWTON && PHI_ADJOINT
/* Solve M^T x = `side` for the matrix M in `matrix`; `side` receives x, and `matrix` is overwritten. M^T has zeros at
   other places than M, so its elimination is separate code. Returns 0 if M is singular. */
static int phi_solve_transposed(double matrix[PHI_DIM * PHI_DIM], double side[PHI_DIM])
{
#if PHI_UNROLLED_TRANSPOSE
    double solution[PHI_DIM], reciprocal[PHI_DIM], largest = 0.0;
    phi_eliminate_transposed(matrix, side, solution, reciprocal);
    for (int i = 0; i < PHI_DIM; ++i)
        if (!(fabs(reciprocal[i]) <= largest)) largest = fabs(reciprocal[i]);
    if (largest < PHI_LARGEST_RECIPROCAL) {
        memcpy(side, solution, sizeof solution);
        return 1;
    }
#endif
    for (int i = 0; i < PHI_DIM; ++i)
        for (int j = 0; j < i; ++j) {
            const double swap = matrix[i * PHI_DIM + j];
            matrix[i * PHI_DIM + j] = matrix[j * PHI_DIM + i];
            matrix[j * PHI_DIM + i] = swap;
        }
#if PHI_UNROLLED
    return phi_solve_pivoting(matrix, side);
#else
    return phi_solve(matrix, side);
#endif
}

#endif
#endif
#endif
