#ifndef PHI_FILE_ADJOINT_EARLY_FLOWS
#define PHI_FILE_ADJOINT_EARLY_FLOWS
#include "adjoint_early.c"

/* Pull the cotangents of time-dependent coefficients back to the other coefficients of their rows, for all flows of a step
   that begins at the time of s. */
static void phi_all_early(const phi_solver *s, phi_cotangent *bar)
{
    for (int k = 0; k < PHI_ROWS_OF_FLOWS; ++k)
        phi_early(s->coef + k * PHI_ROW, bar->coef + k * PHI_ROW, s->t + phi_moments[k] * s->h);
}
#endif
