#ifndef PHI_FILE_ADJOINT_STORED_EXPLICIT
#define PHI_FILE_ADJOINT_STORED_EXPLICIT
#include <math.h>
#include <string.h>
#include "adjoint_stored.c"

/* Pull the cotangents x back through a stage that started at y. */
static inline void phi_pull_stage(phi_lanes *coef, phi_lanes y[restrict PHI_DIM], phi_lanes x[restrict PHI_DIM],
    phi_lanes coef_bar[restrict PHI_COEFFICIENTS])
{
    phi_lanes back[PHI_DIM], slopes[PHI_COEFFICIENTS];
    phi_explicit_adjoint_lanes(coef, y, x, back, slopes);
    for (int i = 0; i < PHI_DIM; ++i) phi_gain_lanes(x[i], back[i]);
    for (int c = 0; c < PHI_COEFFICIENTS; ++c) phi_gain_lanes(coef_bar[c], slopes[c]);
}
#endif
