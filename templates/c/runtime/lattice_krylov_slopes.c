#ifndef PHI_FILE_LATTICE_KRYLOV_SLOPES
#define PHI_FILE_LATTICE_KRYLOV_SLOPES
#include "lattice.h"
#include "model.h"

#if PHI_ADJOINT
/* Compute `to` = v - J v, where J is the derivative of a sweep with respect to y at s->y[now]. In a reverse pass
   s->side is not NULL; then compute `to` = v - J^T v. */
#else
/* Compute `to` = v - J v, where J is the derivative of a sweep with respect to y at s->y[now]. */
#endif
static void phi_multiply(const phi_solver *s, const double *coef, int now, double *const *v, double *const *to)
{
    const size_t units = phi_units(s);
#if PHI_ADJOINT
    if (s->side != NULL) {
        phi_pull(s, PHI_SLOPE_BACK, coef, v, NULL, to);
        phi_combine(s, to, 1.0, v, -1.0, to);
        return;
    }
#endif
    PHI_EACH_PIECE
    for (size_t unit = 0; unit < units; ++unit) phi_slope_piece(s, coef, s->y[now], v, to, unit);
    phi_combine(s, to, 1.0, v, -1.0, to);
}
#endif
