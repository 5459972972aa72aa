#ifndef PHI_FILE_LATTICE_CLOCK
#define PHI_FILE_LATTICE_CLOCK
#include <math.h>
#include <string.h>

#include "lattice.h"
#include "model.h"

double phi_solver_time(const phi_solver *s) { return s->t; }

void phi_saved_clock(const phi_solver *s, double clock[5])
{
    clock[0] = s->level;
    memcpy(clock + 1, s->clock, 4 * sizeof *clock);
}

phi_status phi_resume_clock(phi_solver *s, const double clock[5])
{
    if (s == NULL || clock == NULL || !phi_finite(clock, 5)) return PHI_BAD_ARGUMENT;
    s->level = clock[0];
    memcpy(s->clock, clock + 1, 4 * sizeof *clock);
    s->t = s->clock[0] + s->clock[1];
    return PHI_OK;
}
#endif
