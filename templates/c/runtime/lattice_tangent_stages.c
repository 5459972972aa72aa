#ifndef PHI_FILE_LATTICE_TANGENT_STAGES
#define PHI_FILE_LATTICE_TANGENT_STAGES
#include "lattice.h"
#include "model.h"

/* Make a step of the state and the tangent vectors. */
static phi_status phi_carry(phi_solver *s) { return phi_stages(s PHI_AND_FULL_RANGE(1)); }
#endif
