#ifndef PHI_FILE_LATTICE_MONITOR
#define PHI_FILE_LATTICE_MONITOR
#include <math.h>
#include <string.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "sweeps.h"
#include "lattice_share.c"

/* ---- Steps equal in a time tau: steps of K = log(A + e) - log(-B), where H = A + B and e = -H(x0) ---- */
#include "lattice_density.c"
#include "lattice_density_slopes.c"

/* Sum of s->densities over all sites, compensated after A. Neumaier. It waits until all threads have filled their parts. */
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

/* The value of a part of H at x, with the same bits in all threads; called by all threads together. */
static double phi_part_energy(const phi_solver *s, int part)
{
    size_t first, end = phi_share(phi_units(s), &first);
    for (size_t unit = first; unit < end; ++unit) {
        const phi_row row = phi_piece_of(s, unit);
        phi_part_density(&row, part, s->densities + row.from);
    }
    return phi_sum_of_densities(s);
}

/* The number by which times are divided: A + e for the part log(A + e) of K, -B for the part -log(-B). The flow of a
   part of K over a time is the flow of A or B over that time divided by this number. */
static double phi_rate(const phi_solver *s, int part)
{
    const double energy = phi_part_energy(s, part);
    return part == PHI_NEGATIVE ? -energy : energy + s->level;
}

/* Set e = -H at the present state. Returns 0 if H is not finite, or if -B is not positive, where time would not increase. */
static int phi_take_level(phi_solver *s)
{
    const double negative = phi_part_energy(s, PHI_NEGATIVE), energy = phi_part_energy(s, 3 - PHI_NEGATIVE) + negative;
    s->level = -energy;
    return isfinite(energy) && negative < 0.0;
}

/* Add the time of a flow to the physical time of the state: s->clock[0], with the compensation term s->clock[1]. */
static void phi_pass(const phi_solver *s, double time)
{
    const double before = s->clock[0], sum = before + time, added = sum - before;
    s->clock[1] += (before - (sum - added)) + (time - added);
    s->clock[0] = sum;
}

/* Copy the physical time and its compensation term with the fields, from s->before to s->x or back: the first two numbers of
   s->clock belong to s->x, the next two to s->before. */
static void phi_copy_clock(const phi_solver *s, double *const *to)
{
    const size_t into = to == s->before ? 2 : 0;
    memcpy(s->clock + into, s->clock + 2 - into, 2 * sizeof *s->clock);
}
#endif
