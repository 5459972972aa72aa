#ifndef PHI_FILE_LATTICE_PLAIN_FLOWS
#define PHI_FILE_LATTICE_PLAIN_FLOWS
#include "lattice.h"
#include "model.h"

/* Apply flow `number` of step `steps`. Number PHI_FLOWS is the last flow merged with flow 0. */
static void phi_apply_flow(const phi_solver *s, size_t steps, int number)
{
#if PHI_BODIES && !PHI_SHARED
    if (phi_flow_parts[number] == PHI_REMAINDER) phi_gather_pulls(s, s->coef + number * PHI_ROW);
    else phi_move_centre(s->x, phi_times[number] * s->h);
#endif
#if PHI_RENEWED
    double coef[PHI_ROW];
    phi_renew(s, number, steps, coef);
    phi_sweep_part(s, phi_flow_parts[number], coef PHI_AND_FULL_RANGE(s->full_range > 0));
#else
    (void)steps;
    phi_sweep_part(s, phi_flow_parts[number], s->coef + number * PHI_ROW PHI_AND_FULL_RANGE(s->full_range > 0));
#endif
#if PHI_BODIES && PHI_SHARED
    if (phi_flow_parts[number] == PHI_REMAINDER || PHI_THREAD > 0) return;
    phi_move_centre(s->x, phi_times[number] * s->h);
#if PHI_TANGENT
    for (size_t k = 0; k < s->vectors; ++k) {
        double *v[PHI_DIM];
        phi_vector(s, k, v);
        phi_move_centre(v, phi_times[number] * s->h);
    }
#endif
#endif
}
#endif
