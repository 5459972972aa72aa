#ifndef PHI_FILE_ELAPSED
#define PHI_FILE_ELAPSED
#include "solver.h"

/* Add the physical time of a stage to the time of the solver, in compensated arithmetic. */
static void phi_pass(phi_solver *s, double elapsed)
{
    const double sum = s->t + elapsed, added = sum - s->t;
    const double rest = s->t_carry + ((s->t - (sum - added)) + (elapsed - added));
    s->t = sum + rest;
    s->t_carry = rest - (s->t - sum);
}

double phi_solver_time(const phi_solver *s) { return s->t + s->t_carry; }
#endif
