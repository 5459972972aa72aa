#ifndef PHI_FILE_DEVICE_LINEAR
#define PHI_FILE_DEVICE_LINEAR
#include "model.h"

/* Exchange two numbers if a condition holds. */
static inline void phi_exchange(int condition, double *a, double *b)
{
    const double first = *a, second = *b;
    *a = condition ? second : first;
    *b = condition ? first : second;
}

/* Solve `matrix` * x = `side` by elimination with partial pivoting; `side` receives x, and `matrix` is overwritten.
   Returns 0 if the matrix is singular. Loops have constant bounds, so that a compiler can keep all entries in
   registers. */
static int phi_solve(double matrix[PHI_DIM * PHI_DIM], double side[PHI_DIM])
{
    int regular = 1;
    PHI_UNROLL
    for (int k = 0; k < PHI_DIM; ++k) {
        int best = k;
        double largest = fabs(matrix[k * PHI_DIM + k]);
        PHI_UNROLL
        for (int i = k + 1; i < PHI_DIM; ++i) {
            const int larger = fabs(matrix[i * PHI_DIM + k]) > largest;
            best = larger ? i : best;
            largest = larger ? fabs(matrix[i * PHI_DIM + k]) : largest;
        }
        regular = regular && largest > 0.0;
        PHI_UNROLL
        for (int i = k + 1; i < PHI_DIM; ++i) {
            PHI_UNROLL
            for (int j = k; j < PHI_DIM; ++j) phi_exchange(best == i, &matrix[k * PHI_DIM + j], &matrix[i * PHI_DIM + j]);
            phi_exchange(best == i, &side[k], &side[i]);
        }
        PHI_UNROLL
        for (int i = k + 1; i < PHI_DIM; ++i) {
            const double factor = matrix[i * PHI_DIM + k] / matrix[k * PHI_DIM + k];
            PHI_UNROLL
            for (int j = k + 1; j < PHI_DIM; ++j) matrix[i * PHI_DIM + j] -= factor * matrix[k * PHI_DIM + j];
            side[i] -= factor * side[k];
        }
    }
    PHI_UNROLL
    for (int i = PHI_DIM - 1; i >= 0; --i) {
        PHI_UNROLL
        for (int j = i + 1; j < PHI_DIM; ++j) side[i] -= matrix[i * PHI_DIM + j] * side[j];
        side[i] /= matrix[i * PHI_DIM + i];
    }
    return regular;
}
#endif
