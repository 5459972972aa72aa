#ifndef PHI_FILE_RENEWED_FLOWS
#define PHI_FILE_RENEWED_FLOWS
#include "model.h"

/* For the flows of the next step, compute the coefficients that depend on the time. */
static void phi_renew(phi_solver *s)
{
    for (int k = 0; k < PHI_ROWS_OF_FLOWS; ++k) {
        double *row = s->coef + k * PHI_ROW;
        phi_at_time(row PHI_AND_T(s->t + phi_moments[k] * s->h), row + PHI_PREPARED);
    }
}
#endif
