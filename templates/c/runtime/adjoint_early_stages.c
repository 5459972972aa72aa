#ifndef PHI_FILE_ADJOINT_EARLY_STAGES
#define PHI_FILE_ADJOINT_EARLY_STAGES
#include "adjoint_early.c"

/* Pull the cotangents of time-dependent coefficients back to the other coefficients, for all stages of a step that begins
   at the time of s. */
static void phi_all_early(const phi_solver *s, phi_cotangent *bar)
{
    PHI_EACH_STAGE
        phi_early(PHI_OF(s->coef, stage), PHI_OF(bar->coef, stage), s->t + PHI_OF(phi_middles, stage) * s->h);
}
#endif
