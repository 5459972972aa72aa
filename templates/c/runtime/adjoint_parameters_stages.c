#ifndef PHI_FILE_ADJOINT_PARAMETERS_STAGES
#define PHI_FILE_ADJOINT_PARAMETERS_STAGES
#include <string.h>

#include "adjoint_stage.c"

/* Add the derivatives of L by the parameters, from those by the coefficients. */
static void phi_add_by_parameters(const phi_solver *s, const phi_cotangent *bar, phi_params *params_bar PHI_AND_DOUBLE(e_bar))
{
    double parameter_bars[sizeof(phi_params) / sizeof(double) + 1];
    PHI_SUMS_OF_PARAMETERS
    PHI_TAKE_SUMS(sums, params_bar)
    PHI_BAR_OF_LEVEL
    PHI_EACH_STAGE {
        phi_prepare_adjoint(&s->params PHI_AND_GAUGE(s->gauge), PHI_FRACTION(s->h), PHI_OF(bar->coef, stage), parameter_bars PHI_AND_LEVEL(level));
        PHI_ADD_TO_SUMS(sums, parameter_bars)
        PHI_ADD_BAR_OF_LEVEL(e_bar)
    }
    PHI_GIVE_SUMS(params_bar, sums)
}
#endif
