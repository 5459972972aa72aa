#ifndef PHI_FILE_LATTICE_KRYLOV_DIFFERENCES
#define PHI_FILE_LATTICE_KRYLOV_DIFFERENCES
#include "lattice.h"
#include "model.h"

/* Compute `to` = v - J v, where J is the derivative of a sweep with respect to y at s->y[now]. J v is a difference
   quotient; s->y[1 - now] must hold the result of the sweep. */
static void phi_multiply(const phi_solver *s, const double *coef, int now, double *const *v, double *const *to)
{
    const size_t units = phi_units(s);
    const double by = 0x1p-26 * sqrt((double)(PHI_DIM * s->sites));
    phi_combine(s, s->y[2], 1.0, s->y[now], by, v);
    PHI_EACH_PIECE
    for (size_t unit = 0; unit < units; ++unit) phi_stage_piece(s, coef PHI_AND_FULL_RANGE(1), s->y[2], to, unit);
    phi_combine(s, to, 1.0 / by, s->y[1 - now], -1.0 / by, to);
    phi_combine(s, to, 1.0, v, 1.0, to);
}
#endif
