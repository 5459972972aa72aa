#ifndef PHI_FILE_LATTICE_DENSITY
#define PHI_FILE_LATTICE_DENSITY
#include "lattice.h"
#include "rows.c"
#include "sweeps.h"

/* The density of a part of H at the sites of a row segment. */
static void phi_part_density(const phi_row *row, int part, double *out)
{
    if (part == 1) phi_part1_row(row, out);
    else phi_part2_row(row, out);
}
#endif
