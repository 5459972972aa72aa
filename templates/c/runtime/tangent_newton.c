#ifndef PHI_FILE_TANGENT_NEWTON
#define PHI_FILE_TANGENT_NEWTON
#include <math.h>
#include <string.h>

#include "algebra.c"
#include "model.h"
#include "solver.c"
#include "tangent_implicit.c"
#include "tangent_product.c"

/* Compute the derivative of one implicit stage: 1 + increment_jacobian Dy. The derivative Dy of y by x is jacobian^-1,
   by the equation alpha(y) = x of the stage. The solution y is first refined to rounding level, starting from the
   stored value. */
static phi_status phi_tangent_stage(const double *coef, const double x[PHI_DIM], const double carry[PHI_DIM],
    const double value[PHI_DIM], double change[PHI_DIM], double derivative[PHI_DIM * PHI_DIM])
{
    double y[PHI_DIM], side[PHI_DIM], displacement[PHI_DIM];
    double jacobian[PHI_DIM * PHI_DIM], matrix[PHI_DIM * PHI_DIM], slope[PHI_DIM * PHI_DIM], previous = HUGE_VAL;
    memcpy(y, value, sizeof y);
    for (int iteration = 0; iteration <= PHI_MAX_ITERATIONS; ++iteration) {
        phi_linearise(coef, y, displacement, change, jacobian, slope);
        for (int i = 0; i < PHI_DIM; ++i) side[i] = ((y[i] - x[i]) + displacement[i]) - carry[i];
        memcpy(matrix, jacobian, sizeof matrix);
        if (!phi_solve(matrix, side)) return PHI_SINGULAR;
        const double size = phi_size(y, side);
        if (!isfinite(size)) return PHI_NOT_FINITE;
        if (phi_tangent_solved(size, previous)) break;
        if (iteration == PHI_MAX_ITERATIONS) return PHI_NO_CONVERGENCE;
        for (int i = 0; i < PHI_DIM; ++i) y[i] -= side[i];
        previous = size;
    }
    memset(matrix, 0, sizeof matrix);
    for (int i = 0; i < PHI_DIM; ++i) matrix[i * PHI_DIM + i] = 1.0;
    if (!phi_tangent_solve(jacobian, matrix)) return PHI_SINGULAR;
    phi_tangent_product(slope, matrix, derivative);
    for (int i = 0; i < PHI_DIM; ++i) derivative[i * PHI_DIM + i] += 1.0;
    return PHI_OK;
}
#endif
