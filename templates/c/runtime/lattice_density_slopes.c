#ifndef PHI_FILE_LATTICE_DENSITY_SLOPES
#define PHI_FILE_LATTICE_DENSITY_SLOPES
#include "lattice.h"
#include "rows.c"
#include "sweeps.h"
#include "lattice_share.c"

static double phi_sum_of_densities(const phi_solver *s);

/* The derivative of a part of H along a tangent vector v; called by all threads together. */
static double phi_part_slope(const phi_solver *s, int part, double *const *v)
{
    size_t first, end = phi_share(phi_units(s), &first);
    for (size_t unit = first; unit < end; ++unit) {
        phi_row row = phi_piece_of(s, unit);
        row.varied = v;
        if (part == 1) phi_part1_slope_row(&row, s->densities + row.from);
        else phi_part2_slope_row(&row, s->densities + row.from);
    }
    return phi_sum_of_densities(s);
}
#endif
