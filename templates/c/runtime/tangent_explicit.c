#ifndef PHI_FILE_TANGENT_EXPLICIT
#define PHI_FILE_TANGENT_EXPLICIT
#include "model.h"
#include "solver.h"

/* Compute the change of x in one explicit stage, and the derivative of the stage: 1 + the Jacobian of the increment. The
   arguments carry and value are unused. */
static phi_status phi_tangent_stage(const double *coef, const double x[PHI_DIM], const double carry[PHI_DIM],
    const double value[PHI_DIM], double change[PHI_DIM], double derivative[PHI_DIM * PHI_DIM])
{
    (void)carry;
    (void)value;
    phi_explicit(coef, x, change);
    phi_explicit_tangent(coef, x, derivative);
    for (int i = 0; i < PHI_DIM; ++i) derivative[i * PHI_DIM + i] += 1.0;
    return PHI_OK;
}
#endif
