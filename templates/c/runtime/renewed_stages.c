#ifndef PHI_FILE_RENEWED_STAGES
#define PHI_FILE_RENEWED_STAGES
#include "model.h"

/* For the stages of the next step, compute the coefficients that differ from step to step. */
static void phi_renew(phi_solver *s)
{
    PHI_EACH_STAGE
        PHI_RENEWAL(PHI_OF(s->coef, stage) PHI_AND_T(s->t + PHI_OF(phi_middles, stage) * s->h) PHI_AND_DW(s->dw), PHI_OF(s->coef, stage) + PHI_PREPARED);
}
#endif
