#ifndef PHI_FILE_ADJOINT_NEWTON
#define PHI_FILE_ADJOINT_NEWTON
#include <float.h>
#include <math.h>
#include <string.h>
#include "adjoint_stage.c"

/* Pull a cotangent back through an implicit stage with solution y. The derivative of y by x is jacobian^-1, so the
   derivative of the stage is 1 + increment_jacobian jacobian^-1. */
static phi_status phi_stage_adjoint(const double *coef, const double y[PHI_DIM], phi_cotangent *bar,
    double coef_bar[PHI_COEFFICIENTS])
{
    double displacement[PHI_DIM], increment[PHI_DIM], jacobian[PHI_DIM * PHI_DIM], slope[PHI_DIM * PHI_DIM];
    double back[PHI_DIM], minus[PHI_DIM], slopes[PHI_COEFFICIENTS];
    phi_linearise(coef, y, displacement, increment, jacobian, slope);
    for (int i = 0; i < PHI_DIM; ++i) {
        back[i] = 0.0;
        for (int k = 0; k < PHI_DIM; ++k) back[i] += slope[k * PHI_DIM + i] * bar->x[k];
    }
    if (!phi_solve_transposed(jacobian, back)) return PHI_SINGULAR;
    for (int i = 0; i < PHI_DIM; ++i) minus[i] = -back[i];
    phi_linearise_adjoint(coef, y, minus, bar->x, slopes);
    for (int k = 0; k < PHI_COEFFICIENTS; ++k) coef_bar[k] += slopes[k];
    for (int i = 0; i < PHI_DIM; ++i) bar->x[i] += back[i];
    return PHI_OK;
}
#endif
