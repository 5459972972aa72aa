#ifndef PHI_FILE_ADJOINT_LEVEL_PARAMETERS
#define PHI_FILE_ADJOINT_LEVEL_PARAMETERS
#include <string.h>

#include "solver.h"

/* Add the derivatives that act through the energy level e = -H: subtract e_bar times slope, the derivatives of H by the
   parameters, from *params_bar. */
static void phi_subtract_level(phi_params *params_bar, double e_bar, const double slope[])
{
    double sums[sizeof(phi_params) / sizeof(double)];
    memcpy(sums, params_bar, sizeof sums);
    for (size_t i = 0; i < sizeof sums / sizeof sums[0]; ++i) sums[i] -= e_bar * slope[i];
    memcpy(params_bar, sums, sizeof sums);
}
#endif
