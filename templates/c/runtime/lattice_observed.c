#ifndef PHI_FILE_LATTICE_OBSERVED
#define PHI_FILE_LATTICE_OBSERVED
#include "lattice.h"
#include "model.h"
#include "rows.c"

/* Combine `count` densities of one observable with *sum: add them, with the compensation term *rest after A. Neumaier,
   or take the largest or the smallest (kinds 0 to 3: mean, sum, largest, smallest). */
static void phi_reduce(int kind, size_t count, const double *density, double *sum, double *rest)
{
    for (size_t i = 0; i < count; ++i) {
        const double next = density[i], total = *sum + next;
        if (kind < 2) {
            *rest += fabs(*sum) >= fabs(next) ? (*sum - total) + next : (next - total) + *sum;
            *sum = total;
        } else if (next != next || (kind == 2 ? next > *sum : next < *sum)) {
            *sum = next; /* NaN remains, since no comparison with it is true */
        }
    }
}

void phi_observables(const phi_solver *s, double *out)
{
    double density[PHI_OBSERVABLES * PHI_SHARE], rest[PHI_OBSERVABLES] = { 0.0 };
    for (int k = 0; k < PHI_OBSERVABLES; ++k) {
        const int kind = phi_reductions[k][0];
        out[k] = kind < 2 ? 0.0 : kind == 2 ? -HUGE_VAL : HUGE_VAL;
    }
    PHI_EACH_ROW {
        phi_row row = PHI_WHOLE_ROW;
        for (; row.from < s->length; row.from = row.to) {
            row.to = s->length - row.from > PHI_SHARE ? row.from + PHI_SHARE : s->length;
            phi_observables_row(&row, density);
            for (int k = 0; k < PHI_OBSERVABLES; ++k)
                phi_reduce(phi_reductions[k][0], (size_t)(row.to - row.from), density + k * PHI_SHARE, out + k, rest + k);
        }
    }
    const double sites = (double)s->sites;
#if PHI_GRAPH
    const double counts[3] = { sites, (double)s->bonds[s->sites] / 2.0, 0.0 };
#else
    const double counts[3] = { sites, 0.0, sites * (sites - 1.0) / 2.0 };
#endif
    for (int k = 0; k < PHI_OBSERVABLES; ++k) {
        out[k] += rest[k];
        if (phi_reductions[k][0] == 0) out[k] /= counts[phi_reductions[k][1]];
    }
}
#endif
