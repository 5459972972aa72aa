#ifndef PHI_FILE_LATTICE_TANGENT_FLOWS
#define PHI_FILE_LATTICE_TANGENT_FLOWS
#include "lattice.h"
#include "model.h"

/* Make a step of the state and the tangent vectors, with functions for arguments of any size. */
static phi_status phi_carry(phi_solver *s)
{
    const size_t full_range = s->full_range;
    s->full_range = 1;
    s->open = 0;
    phi_steps(s, 1);
    ++s->steps;
    if (PHI_FLOWS > 1) phi_steps(s, 0);
    --s->steps;
    s->full_range = full_range;
    return phi_all_hold(s, s->x) ? PHI_OK : PHI_NOT_FINITE;
}
#endif
