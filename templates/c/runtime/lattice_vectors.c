#ifndef PHI_FILE_LATTICE_VECTORS
#define PHI_FILE_LATTICE_VECTORS
#include "lattice.h"
#include "model.h"

/* Set v to the arrays of tangent vector `number`. */
static void phi_vector(const phi_solver *s, size_t number, double *v[PHI_DIM])
{
    const size_t block = PHI_DOUBLES;
    for (size_t k = 0; k < PHI_DIM; ++k) v[k] = s->tangents + (number * PHI_DIM + k) * block;
}
#endif
