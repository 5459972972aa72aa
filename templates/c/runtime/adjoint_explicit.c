#ifndef PHI_FILE_ADJOINT_EXPLICIT
#define PHI_FILE_ADJOINT_EXPLICIT
#include <float.h>
#include <math.h>
#include <string.h>
#include "adjoint_stage.c"

/* Pull a cotangent back through a stage that started at y. */
static phi_status phi_stage_adjoint(const double *coef, const double y[PHI_DIM], phi_cotangent *bar,
    double coef_bar[PHI_COEFFICIENTS])
{
    double back[PHI_DIM], slopes[PHI_COEFFICIENTS];
    phi_explicit_adjoint(coef, y, bar->x, back, slopes);
    for (int k = 0; k < PHI_COEFFICIENTS; ++k) coef_bar[k] += slopes[k];
    for (int i = 0; i < PHI_DIM; ++i) bar->x[i] += back[i];
    return PHI_OK;
}
#endif
