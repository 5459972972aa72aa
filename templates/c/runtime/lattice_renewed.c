#ifndef PHI_FILE_LATTICE_RENEWED
#define PHI_FILE_LATTICE_RENEWED
#include "lattice.h"
#include "model.h"

/* Compute a row of coefficients, including time-dependent ones, for the step that follows `steps` steps. */
static void phi_renew(const phi_solver *s, int row, size_t steps, double coef[PHI_ROW])
{
    memcpy(coef, s->coef + row * PHI_ROW, PHI_PREPARED * sizeof *coef);
    phi_refresh(coef, PHI_TIME_AFTER(s, steps) + phi_moments[row] * s->h, coef + PHI_PREPARED);
}
#endif
