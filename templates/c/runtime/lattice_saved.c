#ifndef PHI_FILE_LATTICE_SAVED
#define PHI_FILE_LATTICE_SAVED
#include "lattice.h"
#include "model.h"
#include "rows.c"

int phi_saved(const phi_solver *s, double *x, size_t *far)
{
    *far = s->far;
    if (!s->open) return 0;
    phi_take(s, s->before, x);
    phi_take_carry(s, x + PHI_DIM * s->sites);
    return 1;
}

phi_status phi_resume(phi_solver *s, double h, const double *x, size_t far)
{
    if (s == NULL || (x != NULL && !phi_finite(x, PHI_SAVED_FIELDS * s->sites))) return PHI_BAD_ARGUMENT;
    if (phi_set_step(s, h) != PHI_OK) return PHI_BAD_ARGUMENT;
    s->far = far;
    if (x == NULL) return PHI_OK;
    for (size_t k = 0; k < PHI_DIM; ++k) phi_put(s, s->before[k], x + k * s->sites);
    phi_put_carry(s, x + PHI_DIM * s->sites);
    s->open = 1;
    return PHI_OK;
}
#endif
