#ifndef PHI_FILE_LATTICE_SAVED_NOISE
#define PHI_FILE_LATTICE_SAVED_NOISE
#include "lattice.h"
#include "model.h"

int phi_saved(const phi_solver *s, double *x, size_t *far)
{
    (void)x;
    *far = s->far;
    return s->open;
}

phi_status phi_resume(phi_solver *s, double h, const double *x, size_t far)
{
    if (x != NULL || phi_set_step(s, h) != PHI_OK) return PHI_BAD_ARGUMENT;
    s->far = far;
    return PHI_OK;
}
#endif
