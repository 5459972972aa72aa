#ifndef PHI_FILE_STAGE_ALONE
#define PHI_FILE_STAGE_ALONE
#include "model.h"
#include "newton.c"
#include "path.c"

/* Make one stage of a step. */
static phi_status phi_stage(phi_solver *s PHI_AND_INT_STAGE) { return phi_attempt(s PHI_AND_STAGE); }
#endif
