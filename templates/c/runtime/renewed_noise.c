#ifndef PHI_FILE_RENEWED_NOISE
#define PHI_FILE_RENEWED_NOISE
#include "model.h"

/* For the flows of the next step, compute the coefficients that differ from step to step. A step begins with the flows of
   the noise, and ends with these flows in reverse order. */
static void phi_renew(phi_solver *s)
{
    for (int k = 0; k < PHI_ROWS_OF_FLOWS; ++k) {
        double *row = s->coef + k * PHI_ROW;
        const int late = k - (PHI_ROWS_OF_FLOWS - PHI_DRAWS); /* index in dw, if flow k belongs to the noise and follows the flows of H */
        const double dw[1] = { k < PHI_SOURCES ? s->dw[k] : late >= PHI_SOURCES ? s->dw[late] : 0.0 };
        phi_at_step(row PHI_AND_T(s->t + phi_moments[k] * s->h), dw, row + PHI_PREPARED);
    }
}
#endif
