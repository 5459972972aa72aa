#ifndef PHI_FILE_ADJOINT_EARLY
#define PHI_FILE_ADJOINT_EARLY
#include <string.h>

#include "adjoint_stage.c"

/* Time-dependent coefficients are functions of the time and of the other coefficients of their row. By the chain rule, add
   the derivatives by time-dependent coefficients to the derivatives by the other coefficients. */
static void phi_early(const double *coef, double *coef_bar, double t)
{
    double bar_of_prepared[PHI_PREPARED + 1];
    phi_at_time_adjoint(coef, t, coef_bar + PHI_PREPARED, bar_of_prepared);
    for (int k = 0; k < PHI_PREPARED; ++k) coef_bar[k] += bar_of_prepared[k];
    memset(coef_bar + PHI_PREPARED, 0, PHI_RENEWED_OF_ROW * sizeof coef_bar[0]);
}

#include "adjoint_early_flows.c"
#include "adjoint_early_stages.c"
#endif
