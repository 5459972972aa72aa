#ifndef PHI_FILE_LATTICE_LEVEL_OF_STATE
#define PHI_FILE_LATTICE_LEVEL_OF_STATE
#include "lattice.h"
#include "model.h"
#include "lattice_monitor.c"

/* Take the energy level of the state that a solver is moved to; where it has none, go back to the state before. */
static phi_status phi_begin_level(phi_solver *s)
{
    const double level = s->level;
    if (phi_take_level(s)) return PHI_OK;
    phi_copy(s->x, s->before, s);
    s->level = level;
    return PHI_BAD_ARGUMENT;
}
#endif
