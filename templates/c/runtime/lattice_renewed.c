#ifndef PHI_FILE_LATTICE_RENEWED
#define PHI_FILE_LATTICE_RENEWED
#include "lattice.h"
#include "model.h"

/* Compute a row of time-dependent coefficients for the step after a number of steps. */
static void phi_renew(const phi_solver *s, int row, size_t steps, double coef[PHI_ROW])
{
    memcpy(coef, s->coef + row * PHI_ROW, PHI_PREPARED * sizeof *coef);
    phi_refresh(coef, PHI_TIME_AFTER(s, steps) + phi_moments[row] * s->h, coef + PHI_PREPARED);
}
#endif
