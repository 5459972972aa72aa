#ifndef PHI_FILE_STEP_OF_RUN
#define PHI_FILE_STEP_OF_RUN
#include "solver.h"

phi_status phi_step(phi_solver *s, double h) { return phi_integrate(s, h, 1); }
#endif
