#ifndef PHI_FILE_LATTICE_LATE_FLOWS
#define PHI_FILE_LATTICE_LATE_FLOWS
#include "lattice.h"
#include "model.h"
#include "lattice_monitor.c"

/* Multiply the tangent vectors by the derivative of a flow over the time tau / rate, where rate depends on the state. */
static void phi_carry_vectors(const phi_solver *s, int part, double time, double rate)
{
    size_t first, end = phi_share(phi_units(s), &first);
    for (size_t k = 0; k < s->vectors; ++k) {
        double *v[PHI_DIM], coef[PHI_ROW];
        phi_vector(s, k, v);
        const double slope = phi_part_slope(s, part, v), late[1] = { (part == PHI_NEGATIVE ? slope : -slope) * time / rate };
        phi_prepare(&s->params, time, late, coef);
        phi_tangent_rows(s, part, coef, v, first, end);
    }
}
#endif
