#ifndef PHI_FILE_ATTITUDE_ELEMENT
#define PHI_FILE_ATTITUDE_ELEMENT
#include "model.h"

/* Compute the attitude increment of a stage with solution y; `factor` is its difference from the identity. */
static inline void phi_factor(const phi_solver *s PHI_AND_INT_STAGE, const double y[PHI_DIM], double factor[PHI_ELEMENT])
{
    phi_turn(PHI_OF(s->coef, stage), y, factor);
}
#endif
