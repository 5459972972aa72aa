#ifndef PHI_FILE_LATTICE_SAVED
#define PHI_FILE_LATTICE_SAVED
#include "lattice.h"
#include "model.h"
#include "rows.c"

size_t phi_saved(const phi_solver *s, double *x, size_t *full_range)
{
    *full_range = s->full_range;
    if (!s->open) return 0;
    phi_take(s, s->before, x);
    return PHI_DIM;
}

phi_status phi_resume(phi_solver *s, double h, const double *x, size_t fields, size_t full_range)
{
    if (s == NULL || (fields > 0 && (fields != PHI_DIM || x == NULL || !phi_finite(x, fields * s->sites))))
        return PHI_BAD_ARGUMENT;
    if (phi_set_step(s, h) != PHI_OK) return PHI_BAD_ARGUMENT;
    s->full_range = full_range;
    for (size_t k = 0; k < fields; ++k) phi_put(s, s->before[k], x + k * s->sites);
    s->open = fields > 0;
    return PHI_OK;
}
#endif
