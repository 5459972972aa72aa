#ifndef PHI_FILE_SIZES
#define PHI_FILE_SIZES
#include "solver.h"

size_t phi_solver_size(void) { return sizeof(phi_solver); }
size_t phi_solver_steps_done(const phi_solver *s) { return s->steps; }
#endif
