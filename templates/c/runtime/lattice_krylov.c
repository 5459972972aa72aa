#ifndef PHI_FILE_LATTICE_KRYLOV
#define PHI_FILE_LATTICE_KRYLOV
#include <math.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "sweeps.h"

/* ---- Krylov spaces ---- */
#define PHI_SOLVED 1e-6 /* how well a correction solves the equation for it, if the space allows, */
#define PHI_USEFUL 0.9  /* and how well it has to */

/* The sum over some sites of a b. */
static double phi_product(const double *restrict a, const double *restrict b, ptrdiff_t from, ptrdiff_t to)
{
    double lanes[PHI_WIDTH] = { 0.0 }, sum = 0.0;
    const ptrdiff_t whole = to - (to - from) % PHI_WIDTH;
    for (ptrdiff_t i = from; i < whole; i += PHI_WIDTH)
        for (int l = 0; l < PHI_WIDTH; ++l) lanes[l] += a[i + l] * b[i + l];
    for (ptrdiff_t i = whole; i < to; ++i) sum += a[i] * b[i];
    for (int l = 0; l < PHI_WIDTH; ++l) sum += lanes[l];
    return sum;
}

/* The products of some directions from the first on with v, over all sites and fields, in usual sizes. Those of pieces are
   added in their order: the bits do not depend on threads. */
static void phi_products(const phi_solver *s, int first, int count, double *const *v, double *products)
{
    const size_t units = phi_units(s);
    PHI_PARALLEL
    {
        size_t unit, end = phi_share(units, &unit);
        for (; unit < end; ++unit) {
            const phi_piece at = phi_piece_of(s, unit);
            for (int d = 0; d < count; ++d) {
                double sum = 0.0;
                for (int k = 0; k < PHI_DIM; ++k)
                    sum += phi_product(s->space[first + d][k] + at.row.at[0], v[k] + at.row.at[0], at.from, at.to) /
                        s->usual[k] / s->usual[k];
                s->sums[unit * (PHI_DIRECTIONS + 1) + (size_t)d] = sum;
            }
        }
    }
    for (int d = 0; d < count; ++d) products[d] = 0.0;
    for (size_t unit = 0; unit < units; ++unit)
        for (int d = 0; d < count; ++d) products[d] += s->sums[unit * (PHI_DIRECTIONS + 1) + (size_t)d];
}

/* to = own from + some of the first directions by their weights, with the copied ends. */
static void phi_combine(const phi_solver *s, double *const *to, double own, double *const *from, int count, const double *weights)
{
    PHI_PARALLEL
    {
        size_t unit, end = phi_share(phi_units(s), &unit);
        for (; unit < end; ++unit) {
            const phi_piece at = phi_piece_of(s, unit);
            for (int k = 0; k < PHI_DIM; ++k) {
                const double *start = from[k] + at.row.at[0];
                double *sum = to[k] + at.row.at[0];
                PHI_EACH_SITE
                for (ptrdiff_t i = at.from; i < at.to; ++i) sum[i] = own * start[i];
                for (int d = 0; d < count; ++d) {
                    const double *restrict direction = s->space[d][k] + at.row.at[0], by = weights[d];
                    PHI_EACH_SITE
                    for (ptrdiff_t i = at.from; i < at.to; ++i) sum[i] += by * direction[i];
                }
#if PHI_HALO
                phi_ends(sum, s->length, at.from, at.to);
#endif
            }
        }
    }
}

/* to = a - b; with coefficients b is first made what a sweep does to a, or its transpose. */
static void phi_subtract(phi_solver *s, const double *coef, int now, double *const *a, double *const *b, double *const *to)
{
    PHI_PARALLEL
    {
        size_t first, end = phi_share(phi_units(s), &first);
#if PHI_ADJOINT
        if (coef != NULL && s->side != NULL) phi_pull_rows(s, PHI_SLOPE_BACK, coef, a, NULL, b, first, end);
        if (coef != NULL && s->side == NULL) phi_slope_rows(s, coef, 1, now, a, b, first, end);
#else
        if (coef != NULL) phi_slope_rows(s, coef, 1, now, a, b, first, end);
#endif
        for (size_t unit = first; unit < end; ++unit) {
            const phi_piece at = phi_piece_of(s, unit);
            for (int k = 0; k < PHI_DIM; ++k) {
                const double *one = a[k] + at.row.at[0], *other = b[k] + at.row.at[0];
                double *left = to[k] + at.row.at[0];
                PHI_EACH_SITE
                for (ptrdiff_t i = at.from; i < at.to; ++i) left[i] = one[i] - other[i];
            }
        }
    }
}

#if PHI_SITE_BLOCKS
/* The inverse of a matrix in its place; 1 where there is none. */
static void phi_invert_block(double b[PHI_DIM][PHI_DIM])
{
    double zero = 0.0;
    for (int k = 0; k < PHI_DIM; ++k) {
        const double pivot = 1.0 / b[k][k];
        b[k][k] = 1.0;
        for (int j = 0; j < PHI_DIM; ++j) b[k][j] *= pivot;
        for (int i = 0; i < PHI_DIM; ++i) {
            const double factor = b[i][k];
            if (i == k) continue;
            b[i][k] = 0.0;
            for (int j = 0; j < PHI_DIM; ++j) b[i][j] -= factor * b[k][j];
        }
    }
    for (int k = 0; k < PHI_DIM * PHI_DIM; ++k) zero += 0.0 * b[k / PHI_DIM][k % PHI_DIM];
    for (int k = 0; zero != 0.0 && k < PHI_DIM * PHI_DIM; ++k) b[k / PHI_DIM][k % PHI_DIM] = k % (PHI_DIM + 1) == 0;
}

/* Where fields at a site act on each other by much, as a momentum and its field do, a space of the matrix times the inverses of what
   it does at the sites themselves takes half as many directions. These inverses at s->y[now]. */
static void phi_invert_blocks(const phi_solver *s, const double *coef, int now)
{
    PHI_PARALLEL
    {
        size_t first, end = phi_share(phi_units(s), &first);
#if PHI_ADJOINT
        phi_own_slope_rows(s, coef, 1, s->side != NULL ? 2 : now, first, end);
#else
        phi_own_slope_rows(s, coef, 1, now, first, end);
#endif
        for (size_t unit = first; unit < end; ++unit) {
            const phi_piece at = phi_piece_of(s, unit);
            for (ptrdiff_t i = at.from; i < at.to; ++i) {
                double b[PHI_DIM][PHI_DIM];
                for (int k = 0; k < PHI_DIM * PHI_DIM; ++k)
                    b[k / PHI_DIM][k % PHI_DIM] = (k % (PHI_DIM + 1) == 0) - s->block[k][at.row.at[0] + i];
                phi_invert_block(b);
                for (int k = 0; k < PHI_DIM * PHI_DIM; ++k) s->block[k][at.row.at[0] + i] = b[k / PHI_DIM][k % PHI_DIM];
            }
        }
    }
}

/* to = from + these inverses times v; without from that alone. */
static void phi_apply_blocks(const phi_solver *s, double *const *v, double *const *from, double *const *to)
{
    PHI_PARALLEL
    {
        size_t unit, end = phi_share(phi_units(s), &unit);
        for (; unit < end; ++unit) {
            const phi_piece at = phi_piece_of(s, unit);
            for (int k = 0; k < PHI_DIM; ++k) {
                double *sum = to[k] + at.row.at[0];
                for (ptrdiff_t i = at.from; i < at.to; ++i) sum[i] = from == NULL ? 0.0 : from[k][at.row.at[0] + i];
                for (int l = 0; l < PHI_DIM; ++l) {
#if PHI_ADJOINT
                    const int entry = s->side != NULL ? l * PHI_DIM + k : k * PHI_DIM + l;
#else
                    const int entry = k * PHI_DIM + l;
#endif
                    const double *one = v[l] + at.row.at[0], *by = s->block[entry] + at.row.at[0];
                    PHI_EACH_SITE
                    for (ptrdiff_t i = at.from; i < at.to; ++i) sum[i] += by[i] * one[i];
                }
#if PHI_HALO
                phi_ends(sum, s->length, at.from, at.to);
#endif
            }
        }
    }
}

#endif
/* to = from - what solves matrix(v) = s->space[0], as well as a space of so many directions allows: GMRES, after Y. Saad
   and M. H. Schultz, without a restart. The matrix is 1 - (what a sweep does to a variation of s->y[now]). s->y[1 - now]
   is used, and may be where it goes. The length of s->space[0]; not finite if this is of no use. */
static double phi_krylov(phi_solver *s, const double *coef, int now, double *const *from, double *const *to)
{
    double matrix[PHI_DIRECTIONS][PHI_DIRECTIONS], again[PHI_DIRECTIONS], cosine[PHI_DIRECTIONS], sine[PHI_DIRECTIONS];
    double side[PHI_DIRECTIONS + 1], length;
    int count = 0;
    phi_products(s, 0, 1, s->space[0], &length);
    side[0] = length = sqrt(length);
    if (length > 0.0) phi_combine(s, s->space[0], 1.0 / length, s->space[0], 0, side);
    while (count < PHI_DIRECTIONS && fabs(side[count]) > PHI_SOLVED * length) {
        double *column = matrix[count], *const *next = s->space[count + 1], left;
#if PHI_SITE_BLOCKS
        phi_apply_blocks(s, s->space[count], NULL, s->solved);
        phi_subtract(s, coef, now, s->solved, s->y[1 - now], next);
#else
        phi_subtract(s, coef, now, s->space[count], s->y[1 - now], next);
#endif
        phi_products(s, 0, count + 1, next, column);
        for (int k = 0; k <= count; ++k) again[k] = -column[k];
        phi_combine(s, next, 1.0, next, count + 1, again);
        phi_products(s, 0, count + 1, next, again); /* twice is enough */
        for (int k = 0; k <= count; ++k) {
            column[k] += again[k];
            again[k] = -again[k];
        }
        phi_combine(s, next, 1.0, next, count + 1, again);
        phi_products(s, count + 1, 1, next, &left);
        left = sqrt(left);
        if (left > 0.0) phi_combine(s, next, 1.0 / left, next, 0, again);
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
    for (int k = 0; k < count; ++k) side[k] = -side[k];
#if PHI_SITE_BLOCKS
    phi_combine(s, s->space[count], 0.0, s->space[0], count, side);
    phi_apply_blocks(s, s->space[count], from, to);
#else
    phi_combine(s, to, 1.0, from, count, side);
#endif
    return length;
}
#endif
