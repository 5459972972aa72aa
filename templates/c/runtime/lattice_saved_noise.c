#ifndef PHI_FILE_LATTICE_SAVED_NOISE
#define PHI_FILE_LATTICE_SAVED_NOISE
#include "lattice.h"
#include "model.h"

size_t phi_saved(const phi_solver *s, double *x, size_t *full_range)
{
    (void)x;
    *full_range = s->full_range;
    return 0;
}

phi_status phi_resume(phi_solver *s, double h, const double *x, size_t fields, size_t full_range)
{
    if (x != NULL || fields != 0 || phi_set_step(s, h) != PHI_OK) return PHI_BAD_ARGUMENT;
    s->full_range = full_range;
    return PHI_OK;
}
#endif
