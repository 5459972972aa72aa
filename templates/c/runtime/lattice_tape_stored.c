#ifndef PHI_FILE_LATTICE_TAPE_STORED
#define PHI_FILE_LATTICE_TAPE_STORED
#include "lattice.h"
#include "model.h"

size_t phi_trail_size(const phi_solver *s, size_t steps)
{
    const size_t of_step = phi_step_tape_size(s) * sizeof(double);
    if (steps > SIZE_MAX / 8 / of_step) return 0;
    return phi_always(s) * sizeof(double) + steps * of_step + phi_state_size(s) + 64;
}
#endif
