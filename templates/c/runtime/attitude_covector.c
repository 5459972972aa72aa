#ifndef PHI_FILE_ATTITUDE_COVECTOR
#define PHI_FILE_ATTITUDE_COVECTOR
#include "model.h"
#include "attitude_matrices.c"

/* Compute the attitude increment of a stage with solution y, the exponential of a matrix; `factor` is its difference
   from the identity. */
static inline void phi_factor(const phi_solver *s PHI_AND_INT_STAGE, const double y[PHI_DIM], double factor[PHI_ELEMENT])
{
    double p[PHI_COVECTOR];
    phi_turn(PHI_OF(s->coef, stage), y, p);
    phi_matrix_exponential(p, factor);
}
#endif
