#ifndef PHI_FILE_DEVICE_SOLVER
#define PHI_FILE_DEVICE_SOLVER
#include "device_solver.h"

static void phi_empty(phi_solver *s)
{
    const phi_solver empty = { { 0.0 } };
    *s = empty;
}

#include "solver.c"
#endif
