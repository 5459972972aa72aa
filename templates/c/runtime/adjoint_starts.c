#ifndef PHI_FILE_ADJOINT_STARTS
#define PHI_FILE_ADJOINT_STARTS
#include <string.h>

#include "adjoint_stage.c"

/* Compute the states before all later stages of a step from the state before the first. */
static void phi_find_starts(const phi_solver *s, phi_step_tape tape)
{
    double change[PHI_DIM];
    for (int stage = 1; stage < PHI_STAGES; ++stage) {
        phi_explicit(s->coef[stage - 1], tape[stage - 1], change);
        for (int i = 0; i < PHI_DIM; ++i) tape[stage][i] = tape[stage - 1][i] + change[i];
    }
}
#endif
