#ifndef PHI_FILE_LATTICE_MONITORED_FLOWS
#define PHI_FILE_LATTICE_MONITORED_FLOWS
#include "lattice.h"
#include "model.h"
#include "lattice_monitor.c"
#include "lattice_late_flows.c"

/* Apply flow `number` of a step, the flow of a part of K. Number PHI_FLOWS is the last flow merged with flow 0. If the
   physical time would not increase, the state becomes NaN. */
static void phi_apply_flow(const phi_solver *s, size_t steps, int number)
{
    double coef[PHI_ROW];
    const int part = phi_flow_parts[number];
    const double rate = phi_rate(s, part), time = phi_times[number] * s->h / (rate > 0.0 ? rate : 0.0);
    (void)steps;
    phi_carry_vectors(s, part, time, rate);
    phi_prepare(&s->params, time PHI_AND_ON_TIME, coef);
    phi_sweep_part(s, part, coef PHI_AND_FULL_RANGE(s->full_range > 0));
    if (part != PHI_NEGATIVE && PHI_THREAD == 0) phi_pass(s, time);
}
#endif
