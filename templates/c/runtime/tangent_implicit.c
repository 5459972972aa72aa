#ifndef PHI_FILE_TANGENT_IMPLICIT
#define PHI_FILE_TANGENT_IMPLICIT
#include <string.h>

#include "algebra.c"
#include "tangent_policy.h"

/* Whether Newton's method has reached rounding level, judged by the relative sizes of its last two corrections. */
static int phi_tangent_solved(double size, double previous)
{
    const int stalled = size < PHI_TANGENT_NEARLY_SOLVED && size > PHI_TANGENT_SHRINKING * previous;
    return size <= PHI_TANGENT_SOLVED || stalled;
}

/* Solve `matrix` * X = `sides` for all columns of X; `sides` receives X. Returns 0 if the matrix is singular. */
static int phi_tangent_solve(const double matrix[PHI_DIM * PHI_DIM], double sides[PHI_DIM * PHI_DIM])
{
    for (int j = 0; j < PHI_DIM; ++j) {
        double copy[PHI_DIM * PHI_DIM], side[PHI_DIM];
        memcpy(copy, matrix, sizeof copy);
        for (int i = 0; i < PHI_DIM; ++i) side[i] = sides[i * PHI_DIM + j];
        if (!phi_solve(copy, side)) return 0;
        for (int i = 0; i < PHI_DIM; ++i) sides[i * PHI_DIM + j] = side[i];
    }
    return 1;
}
#endif
