#ifndef PHI_FILE_RENEWED_NOISE
#define PHI_FILE_RENEWED_NOISE
#include "model.h"

/* Compute the coefficients of the flows of the next step that depend on the noise, and on the time if H depends on it.
   The flows of the noise come first and, in reverse order, last. */
static void phi_renew(phi_solver *s)
{
    for (int k = 0; k < PHI_ROWS_OF_FLOWS; ++k) {
        double *row = s->coef + k * PHI_ROW;
        const int late = k - (PHI_ROWS_OF_FLOWS - PHI_DRAWS); /* in the half of the noise after the flows of H */
        const double dw[1] = { k < PHI_SOURCES ? s->dw[k] : late >= PHI_SOURCES ? s->dw[late] : 0.0 };
        phi_at_step(row PHI_AND_T(s->t + phi_moments[k] * s->h), dw, row + PHI_PREPARED);
    }
}
#endif
