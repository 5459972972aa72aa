#ifndef PHI_FILE_LATTICE_KRYLOV
#define PHI_FILE_LATTICE_KRYLOV
#include <math.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "sweeps.h"

/* ---- Krylov spaces ---- */
#include "lattice_newton_policy.h"

/* Scalar product of x and y, each field divided by its usual size. Sums of row segments are added in order, so that the bits
   do not depend on the number of threads. */
static double phi_product(const phi_solver *s, double *const *x, double *const *y)
{
    const size_t units = phi_units(s);
    double sum = 0.0;
    PHI_EACH_PIECE
    for (size_t unit = 0; unit < units; ++unit) {
        const phi_row row = phi_piece_of(s, unit);
        const ptrdiff_t vectors_end = row.to - (row.to - row.from) % PHI_WIDTH;
        s->sums[unit] = 0.0;
        for (int k = 0; k < PHI_DIM; ++k) {
            const double *one = PHI_HERE(x[k]), *other = PHI_HERE(y[k]);
            double lanes[PHI_WIDTH] = { 0.0 };
            for (ptrdiff_t i = row.from; i < vectors_end; i += PHI_WIDTH)
                for (int l = 0; l < PHI_WIDTH; ++l) lanes[l] += one[i + l] * other[i + l];
            for (ptrdiff_t i = vectors_end; i < row.to; ++i) *lanes += one[i] * other[i];
            for (int l = 1; l < PHI_WIDTH; ++l) *lanes += lanes[l];
            s->sums[unit] += *lanes / s->usual[k] / s->usual[k];
        }
    }
    for (size_t unit = 0; unit < units; ++unit) sum += s->sums[unit];
    return sum;
}

/* Compute `to` = a x + b y at all sites, and the halo of `to`. */
static void phi_combine(const phi_solver *s, double *const *to, double a, double *const *x, double b, double *const *y)
{
    const size_t units = phi_units(s);
    PHI_EACH_PIECE
    for (size_t unit = 0; unit < units; ++unit) {
        const phi_row row = phi_piece_of(s, unit);
        for (int k = 0; k < PHI_DIM; ++k) {
            const double *one = PHI_HERE(x[k]), *other = PHI_HERE(y[k]);
            double *sum = PHI_HERE(to[k]);
            PHI_EACH_SITE
            for (ptrdiff_t i = row.from; i < row.to; ++i) sum[i] = a * one[i] + b * other[i];
            PHI_COPY_ENDS(sum, s->length, row.from, row.to)
        }
    }
}

#include "lattice_krylov_slopes.c"
#include "lattice_krylov_differences.c"

#include "lattice_site_blocks.c"

/* Compute `to` = `from` - v, where v solves A v = s->space[0] and phi_multiply multiplies by A. The method is GMRES (Y.
   Saad and M. H. Schultz) with PHI_DIRECTIONS directions, without restart. Returns the norm of s->space[0], or infinity
   if the residual is too large for v to be useful. */
static double phi_krylov(phi_solver *s, const double *coef, int now, double *const *from, double *const *to)
{
    double matrix[PHI_DIRECTIONS][PHI_DIRECTIONS], cosine[PHI_DIRECTIONS], sine[PHI_DIRECTIONS], side[PHI_DIRECTIONS + 1];
    const double length = sqrt(phi_product(s, s->space[0], s->space[0]));
    int count = 0;
    side[0] = length;
    if (length > 0.0) phi_combine(s, s->space[0], 1.0 / length, s->space[0], 0.0, s->space[0]);
    while (count < PHI_DIRECTIONS && fabs(side[count]) > PHI_SOLVED * length) {
        double *column = matrix[count], *const *next = s->space[count + 1];
#if PHI_SITE_BLOCKS
        phi_apply_blocks(s, s->space[count], NULL, s->solved);
        phi_multiply(s, coef, now, s->solved, next);
#else
        phi_multiply(s, coef, now, s->space[count], next);
#endif
        for (int k = 0; k <= count; ++k) {
            column[k] = phi_product(s, s->space[k], next);
            phi_combine(s, next, 1.0, next, -column[k], s->space[k]);
        }
        const double left = sqrt(phi_product(s, next, next));
        if (left > 0.0) phi_combine(s, next, 1.0 / left, next, 0.0, next);
        for (int k = 0; k < count; ++k) {
            const double above = column[k];
            column[k] = cosine[k] * above + sine[k] * column[k + 1];
            column[k + 1] = cosine[k] * column[k + 1] - sine[k] * above;
        }
        const double size = hypot(column[count], left);
        cosine[count] = column[count] / size;
        sine[count] = left / size;
        column[count] = size;
        side[count + 1] = -sine[count] * side[count];
        side[count] *= cosine[count];
        ++count;
    }
    if (!isfinite(length) || (length > 0.0 && !(fabs(side[count]) <= PHI_USEFUL * length))) return HUGE_VAL;
    for (int k = count - 1; k >= 0; --k) {
        for (int j = k + 1; j < count; ++j) side[k] -= matrix[j][k] * side[j];
        side[k] /= matrix[k][k];
    }
#if PHI_SITE_BLOCKS
    phi_combine(s, s->space[count], 0.0, s->space[0], 0.0, s->space[0]);
    for (int k = 0; k < count; ++k) phi_combine(s, s->space[count], 1.0, s->space[count], -side[k], s->space[k]);
    phi_apply_blocks(s, s->space[count], from, to);
#else
    phi_combine(s, to, 1.0, from, 0.0, from);
    for (int k = 0; k < count; ++k) phi_combine(s, to, 1.0, to, -side[k], s->space[k]);
#endif
    return length;
}
#endif
