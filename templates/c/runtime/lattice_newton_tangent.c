#ifndef PHI_FILE_LATTICE_NEWTON_TANGENT
#define PHI_FILE_LATTICE_NEWTON_TANGENT
#include "lattice.h"
#include "model.h"

#include "lattice_tangent_policy.h"

/* Multiply tangent vector `number` by the derivative of a stage with solution y = s->y[now]. The change dy of y solves
   dy = S dy + side, where S is the derivative of a sweep by y, and side the derivative of a sweep along the vector.
   Then the change of the increment due to dy is added to the vector. */
static phi_status phi_vary(phi_solver *s, const double *coef, int now, size_t number)
{
    const size_t units = phi_units(s);
    double *v[PHI_DIM], *side[PHI_DIM], *dy[PHI_DIM], before = HUGE_VAL;
    phi_vector(s, number, v);
    phi_vector(s, s->vectors, side);
    phi_vector(s, s->vectors + 1, dy);
    PHI_EACH_PIECE
    for (size_t unit = 0; unit < units; ++unit) phi_side_piece(s, coef, s->y[now], v, side, unit);
#if PHI_SITE_BLOCKS
    phi_invert_blocks(s, coef, now);
#endif
    const double size = sqrt(phi_product(s, side, side));
    phi_combine(s, dy, 1.0, side, 0.0, side);
    for (int correction = 0; correction < PHI_MOST_SWEEPS; ++correction) {
        phi_multiply(s, coef, now, dy, s->space[0]);
        phi_combine(s, s->space[0], 1.0, s->space[0], -1.0, side);
        const double left = phi_krylov(s, coef, now, dy, dy);
        if (!isfinite(left)) return PHI_NO_CONVERGENCE;
        if (left <= PHI_CARRIED * size || (left > PHI_CARRIED_SHRINKING * before && left <= PHI_NEARLY_CARRIED * size)) {
            PHI_EACH_PIECE
            for (size_t unit = 0; unit < units; ++unit) phi_follow_piece(s, coef, s->y[now], dy, v, unit);
            return PHI_OK;
        }
        before = left;
    }
    return PHI_NO_CONVERGENCE;
}
#endif
