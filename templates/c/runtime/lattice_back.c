#ifndef PHI_FILE_LATTICE_BACK
#define PHI_FILE_LATTICE_BACK
#include <string.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"

/* ---- Reverse pass of sweeps ---- */
#include "lattice_shares.c"

/* Copy segments of rows, with their halo, to the tape. If there is a single row, its halo is computed here, since
   another thread may be writing it. Sums over pairs may read numbers after the last site, which they do not use; these
   become 0. */
static void phi_store_units(const phi_solver *s, const double *from, double *to, size_t first, size_t end)
{
#if PHI_ONE_ROW
    const ptrdiff_t begin = (ptrdiff_t)first * PHI_PIECE, stop = end == phi_units(s) ? s->length : (ptrdiff_t)end * PHI_PIECE;
    if (first < end) memcpy(PHI_FIRST_SITE(to) + begin, PHI_FIRST_SITE(from) + begin, (size_t)(stop - begin) * sizeof *to);
#if PHI_PAIRS
    if (stop == s->length) memset(to + stop, 0, (size_t)(s->width - stop) * sizeof *to);
#endif
#if PHI_HALO
    if (first < end) phi_ends(PHI_FIRST_SITE(to), s->length, begin, stop);
#endif
#else
    const size_t begin = first * (size_t)s->width, stop = end * (size_t)s->width;
    memcpy(to + begin, from + begin, (stop - begin) * sizeof *to);
#endif
}

/* Compute the offsets in memory of the rows whose terms contribute to the cotangents of a row. For rows beyond open
   ends, it is the offset of the row of zeros that follows all other rows. */
static void phi_find_givers(const phi_solver *s, size_t index, ptrdiff_t at[PHI_LINES])
{
    ptrdiff_t place[PHI_AXES];
    phi_place(s, index, place);
    for (int k = 0; k < PHI_LINES; ++k) {
        at[k] = s->lines[index * PHI_LINES + (size_t)k];
        for (int a = 0; a < PHI_AXES - 1; ++a) {
            const ptrdiff_t p = place[a] + phi_lines[k][a];
            if (phi_open[a] && (p < 0 || p >= (ptrdiff_t)s->sizes[a])) at[k] = PHI_BEYOND;
        }
    }
}

/* Add the derivatives by a parameter at sites to those of the caller, unless `to` is NULL. */
static void phi_add_at_sites(const phi_solver *s, const double *bar, double *to)
{
    if (to == NULL) return;
    PHI_EACH_ROW {
        const double *row = PHI_ROW_AT(bar);
        for (ptrdiff_t i = 0; i < s->length; ++i) *to++ += row[i];
    }
}

#if PHI_BOND_PARAMETERS
/* Add the derivatives by a parameter at bonds to those of the caller, unless `to` is NULL. */
static void phi_add_at_bonds(const phi_solver *s, const double *bar, double *to)
{
    for (int k = 0; to != NULL && k < s->bonds[s->sites]; ++k) to[s->number[k]] += bar[k];
}

#endif
#include "adjoint_sweeps.h"
#if PHI_SERIES

/* Compute `to` = `from` (0 if NULL) + (transpose of the derivative of a kernel at y = s->y[2]) v, for all row segments.
   Called by all threads together. */
static void phi_pull_rows(const phi_solver *s, int kernel, const double *coef, double *const *v, double *const *from,
    double *const *to, size_t first, size_t end)
{
    for (size_t unit = first; unit < end && from != to; ++unit) {
        const phi_row row = phi_piece_of(s, unit);
        for (int k = 0; k < PHI_DIM; ++k) {
            double *sum = PHI_HERE(to[k]);
            for (ptrdiff_t i = row.from; i < row.to; ++i) sum[i] = from == NULL ? 0.0 : from[k][PHI_SITE(i)];
        }
    }
    phi_back_rows(s, kernel, coef PHI_AND_FULL_RANGE(s->wide), v, to, s->shares + (coef - s->coef), first, end);
#if PHI_HANDS
    if (!phi_hands[kernel - 1]) return;
    phi_wait();
#if PHI_GATHER
    phi_hand_rows(s, kernel, to, s->shares + PHI_COEFFICIENTS, first, end);
#else
    phi_hand_rows(s, kernel, to, first, end);
#endif
#endif
}
#endif
#endif
