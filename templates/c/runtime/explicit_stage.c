#ifndef PHI_FILE_EXPLICIT_STAGE
#define PHI_FILE_EXPLICIT_STAGE
#include "algebra.c"
#include "model.h"

/* Make one explicit stage: x + increment(x). */
static phi_status phi_stage(phi_solver *s PHI_AND_INT_STAGE)
{
    double increment[PHI_DIM];
    phi_explicit(PHI_OF(PHI_COEFFICIENTS_OF(s), stage), s->x, increment);
    ++s->evaluations;
    return phi_advance(s, increment, s->carry) ? PHI_OK : PHI_NOT_FINITE;
}
#endif
