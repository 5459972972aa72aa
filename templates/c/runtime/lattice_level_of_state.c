#ifndef PHI_FILE_LATTICE_LEVEL_OF_STATE
#define PHI_FILE_LATTICE_LEVEL_OF_STATE
#include "lattice.h"
#include "model.h"
#include "lattice_monitor.c"

/* Set the energy level of a new state; if the state is not admissible, restore the former state and level. */
static phi_status phi_begin_level(phi_solver *s)
{
    const double level = s->level;
    if (phi_take_level(s)) return PHI_OK;
    phi_copy(s->x, s->before, s);
    s->level = level;
    return PHI_BAD_ARGUMENT;
}
#endif
