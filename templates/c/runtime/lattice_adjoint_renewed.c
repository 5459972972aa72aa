#ifndef PHI_FILE_LATTICE_ADJOINT_RENEWED
#define PHI_FILE_LATTICE_ADJOINT_RENEWED
#include "lattice.h"
#include "model.h"

/* Add the cotangents of the coefficients of one step to coef_bar. The cotangents of time-dependent coefficients are first
   pulled back to the other coefficients. */
static void phi_add_up_step(const phi_solver *s, phi_transpose *g, size_t steps, double coef_bar[PHI_SUMS])
{
    double coef_sums[PHI_SUMS] = { 0.0 }, early[PHI_PREPARED];
    phi_add_up(s, g, coef_sums);
    for (int k = PHI_COEFFICIENTS; k < PHI_SUMS; ++k) coef_bar[k] += coef_sums[k];
#if PHI_SERIES
    PHI_EACH_STAGE {
        const double *coef = PHI_ROW_OF(s->coef, stage), middle = PHI_OF(phi_middles, stage);
        double *sums = PHI_ROW_OF(coef_sums, stage), *to = PHI_ROW_OF(coef_bar, stage);
#else
    for (int row = 0; row < PHI_ROWS_OF_FLOWS; ++row) {
        double *sums = coef_sums + row * PHI_ROW, *to = coef_bar + row * PHI_ROW, coef[PHI_ROW];
        const double middle = phi_moments[row];
        phi_renew(s, row, steps, coef);
#endif
        phi_refresh_adjoint(coef, PHI_TIME_AFTER(s, steps) + middle * s->h, sums + PHI_PREPARED, early);
        for (int k = 0; k < PHI_PREPARED; ++k) to[k] += sums[k] + early[k];
    }
}
#endif
