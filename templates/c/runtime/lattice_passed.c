#ifndef PHI_FILE_LATTICE_PASSED
#define PHI_FILE_LATTICE_PASSED
#include "lattice.h"
#include "model.h"

phi_status phi_passed(phi_solver *s, double h, size_t steps)
{
    const phi_status status = phi_set_step(s, h);
    if (status != PHI_OK || steps < s->steps_before_h) return PHI_BAD_ARGUMENT;
    s->steps = steps;
    PHI_SET_TIME(s) PHI_TIME_AFTER(s, steps);
    return PHI_OK;
}
#endif
