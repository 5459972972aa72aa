#ifndef PHI_FILE_LATTICE_MONITOR
#define PHI_FILE_LATTICE_MONITOR
#include <math.h>
#include <string.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "sweeps.h"
#include "lattice_share.c"

/* ---- Steps equal in tau: those of K = log(A + e) - log(-B), where H = A + B ---- */
#include "lattice_density.c"
#include "lattice_density_slopes.c"

/* The sum of densities at the sites in s->densities, compensated after A. Neumaier, once all threads have filled theirs. */
static double phi_sum_of_densities(const phi_solver *s)
{
    double sum = 0.0, rest = 0.0;
    phi_wait();
    for (size_t i = 0; i < s->sites; ++i) {
        const double density = s->densities[i], total = sum + density;
        rest += fabs(sum) >= fabs(density) ? (sum - total) + density : (density - total) + sum;
        sum = total;
    }
    phi_wait(); /* before a thread overwrites densities that another has still to add */
    return sum + rest;
}

/* The value of a part of H, the same for all threads. */
static double phi_part_energy(const phi_solver *s, int part)
{
    size_t first, end = phi_share(phi_units(s), &first);
    for (size_t unit = first; unit < end; ++unit) {
        const phi_row row = phi_piece_of(s, unit);
        phi_part_density(&row, part, s->densities + row.from);
    }
    return phi_sum_of_densities(s);
}

/* A + e or -B: the flow of a part of K for a time is that of the part of H for the time divided by this. */
static double phi_rate(const phi_solver *s, int part)
{
    const double energy = phi_part_energy(s, part);
    return part == PHI_NEGATIVE ? -energy : energy + s->level;
}

/* Set e = -H at the state. Returns 0 if H is not finite, or -B not positive, so that time would not increase. */
static int phi_take_level(phi_solver *s)
{
    const double negative = phi_part_energy(s, PHI_NEGATIVE), energy = phi_part_energy(s, 3 - PHI_NEGATIVE) + negative;
    s->level = -energy;
    return isfinite(energy) && negative < 0.0;
}

/* Add the time of a flow to the physical time of x, clock[0], with the compensation term clock[1]. */
static void phi_pass(const phi_solver *s, double time)
{
    const double before = s->clock[0], sum = before + time, added = sum - before;
    s->clock[1] += (before - (sum - added)) + (time - added);
    s->clock[0] = sum;
}

/* Copy the physical time with the fields: clock[0] and clock[1] are those of x, the next two those of s->before. */
static void phi_copy_clock(const phi_solver *s, double *const *to)
{
    const size_t into = to == s->before ? 2 : 0;
    memcpy(s->clock + into, s->clock + 2 - into, 2 * sizeof *s->clock);
}
#endif
