#ifndef PHI_FILE_LATTICE_CARRY
#define PHI_FILE_LATTICE_CARRY
#include "lattice.h"
#include "model.h"
#include "rows.c"

/* Set the compensation terms of the fields x to 0. */
static void phi_clear_carry(phi_solver *s)
{
    for (size_t k = 0; k < PHI_DIM; ++k) memset(PHI_MEMORY_OF(s->carry[k]), 0, PHI_DOUBLES * sizeof *s->carry[k]);
}

/* Copy the compensation terms with the fields, from s->before to s->x or back. Of s->carry, the first half belongs to s->x,
   the second half to s->before. */
static void phi_copy_carry(const phi_solver *s, double *const *to)
{
    const size_t block = PHI_DOUBLES * sizeof **to, into = to == s->before ? PHI_DIM : 0;
    for (size_t k = 0; k < PHI_DIM; ++k)
        memcpy(PHI_MEMORY_OF(s->carry[into + k]), PHI_MEMORY_OF(s->carry[PHI_DIM - into + k]), block);
}
#endif
