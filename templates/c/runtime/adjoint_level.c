#ifndef PHI_FILE_ADJOINT_LEVEL
#define PHI_FILE_ADJOINT_LEVEL
#include <string.h>

#include "adjoint_stage.c"
#include "adjoint_level_parameters.c"

void phi_level_bar(const phi_params *params, const double x0[PHI_DIM], double e_bar, double x0_bar[PHI_DIM],
    phi_params *params_bar)
{
    double slope[PHI_DIM], parameter_bars[sizeof(phi_params) / sizeof(double) + 1];
    phi_level_adjoint(params != NULL ? params : &phi_default_params, x0, slope, parameter_bars);
    for (int i = 0; i < PHI_DIM; ++i) x0_bar[i] -= e_bar * slope[i];
    phi_subtract_level(params_bar, e_bar, parameter_bars);
    PHI_NO_NAMED_PARAMETERS(params_bar)
}
#endif
