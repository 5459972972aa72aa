#ifndef PHI_FILE_LATTICE_SAVED_COMPENSATED
#define PHI_FILE_LATTICE_SAVED_COMPENSATED
#include "lattice.h"
#include "model.h"
#include "rows.c"

size_t phi_saved(const phi_solver *s, double *x, size_t *full_range)
{
    *full_range = s->full_range;
    phi_take(s, s->carry, x);
    if (!s->open) return PHI_DIM;
    phi_take(s, s->before, x + PHI_DIM * s->sites);
    phi_take(s, s->carry + PHI_DIM, x + 2 * PHI_DIM * s->sites);
    return 3 * PHI_DIM;
}

phi_status phi_resume(phi_solver *s, double h, const double *x, size_t fields, size_t full_range)
{
    if (s == NULL || (fields != 0 && fields != PHI_DIM && fields != 3 * PHI_DIM)) return PHI_BAD_ARGUMENT;
    if (fields > 0 && (x == NULL || !phi_finite(x, fields * s->sites))) return PHI_BAD_ARGUMENT;
    if (phi_set_step(s, h) != PHI_OK) return PHI_BAD_ARGUMENT;
    s->full_range = full_range;
    for (size_t k = 0; k < fields; ++k) {
        double *const array = k < PHI_DIM ? s->carry[k] : k < 2 * PHI_DIM ? s->before[k - PHI_DIM] : s->carry[k - PHI_DIM];
        phi_put(s, array, x + k * s->sites);
    }
    s->open = fields > PHI_DIM;
    return PHI_OK;
}
#endif
