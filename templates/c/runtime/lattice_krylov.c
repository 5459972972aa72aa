#ifndef PHI_FILE_LATTICE_KRYLOV
#define PHI_FILE_LATTICE_KRYLOV
#include <math.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "sweeps.h"

/* ---- Krylov spaces ---- */
#include "lattice_newton_policy.h"

/* The sum of x y over all sites and fields, in usual sizes. Those of pieces are added in their order: the bits do not depend on
   threads. */
static double phi_product(const phi_solver *s, double *const *x, double *const *y)
{
    const size_t units = phi_units(s);
    double sum = 0.0;
    PHI_EACH_PIECE
    for (size_t unit = 0; unit < units; ++unit) {
        const phi_row row = phi_piece_of(s, unit);
        const ptrdiff_t whole = row.to - (row.to - row.from) % PHI_WIDTH;
        s->sums[unit] = 0.0;
        for (int k = 0; k < PHI_DIM; ++k) {
            const double *one = PHI_HERE(x[k]), *other = PHI_HERE(y[k]);
            double lanes[PHI_WIDTH] = { 0.0 };
            for (ptrdiff_t i = row.from; i < whole; i += PHI_WIDTH)
                for (int l = 0; l < PHI_WIDTH; ++l) lanes[l] += one[i + l] * other[i + l];
            for (ptrdiff_t i = whole; i < row.to; ++i) *lanes += one[i] * other[i];
            for (int l = 1; l < PHI_WIDTH; ++l) *lanes += lanes[l];
            s->sums[unit] += *lanes / s->usual[k] / s->usual[k];
        }
    }
    for (size_t unit = 0; unit < units; ++unit) sum += s->sums[unit];
    return sum;
}

/* to = a x + b y, with the copied ends. */
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

#if PHI_SLOPES
/* to = v - what a sweep, or its transpose, does to that variation of s->y[now]. */
static void phi_multiply(const phi_solver *s, const double *coef, int now, double *const *v, double *const *to)
{
    const size_t units = phi_units(s);
#if PHI_ADJOINT
    if (s->side != NULL) {
        phi_pull(s, PHI_SLOPE_BACK, coef, v, NULL, to);
        phi_combine(s, to, 1.0, v, -1.0, to);
        return;
    }
#endif
    PHI_EACH_PIECE
    for (size_t unit = 0; unit < units; ++unit) phi_slope_piece(s, coef, s->y[now], v, to, unit);
    phi_combine(s, to, 1.0, v, -1.0, to);
}
#else
/* to = v - what a sweep, which makes s->y[1 - now], does to that variation of s->y[now], by a difference. */
static void phi_multiply(const phi_solver *s, const double *coef, int now, double *const *v, double *const *to)
{
    const size_t units = phi_units(s);
    const double by = 0x1p-26 * sqrt((double)(PHI_DIM * s->sites));
    phi_combine(s, s->y[2], 1.0, s->y[now], by, v);
    PHI_EACH_PIECE
    for (size_t unit = 0; unit < units; ++unit) phi_stage_piece(s, coef PHI_AND_FAR(1), s->y[2], to, unit);
    phi_combine(s, to, 1.0 / by, s->y[1 - now], -1.0 / by, to);
    phi_combine(s, to, 1.0, v, 1.0, to);
}
#endif

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
    const size_t units = phi_units(s);
    PHI_EACH_PIECE
    for (size_t unit = 0; unit < units; ++unit) {
        const phi_row row = phi_piece_of(s, unit);
#if PHI_ADJOINT
        phi_own_slope_piece(s, coef, s->y[s->side != NULL ? 2 : now], s->block, unit);
#else
        phi_own_slope_piece(s, coef, s->y[now], s->block, unit);
#endif
        for (ptrdiff_t i = row.from; i < row.to; ++i) {
            double b[PHI_DIM][PHI_DIM];
            for (int k = 0; k < PHI_DIM * PHI_DIM; ++k)
                b[k / PHI_DIM][k % PHI_DIM] = (k % (PHI_DIM + 1) == 0) - s->block[k][PHI_SITE(i)];
            phi_invert_block(b);
            for (int k = 0; k < PHI_DIM * PHI_DIM; ++k) s->block[k][PHI_SITE(i)] = b[k / PHI_DIM][k % PHI_DIM];
        }
    }
}

/* to = from + these inverses times v; without from that alone. */
static void phi_apply_blocks(const phi_solver *s, double *const *v, double *const *from, double *const *to)
{
    const size_t units = phi_units(s);
    PHI_EACH_PIECE
    for (size_t unit = 0; unit < units; ++unit) {
        const phi_row row = phi_piece_of(s, unit);
        for (int k = 0; k < PHI_DIM; ++k) {
            double *sum = PHI_HERE(to[k]);
            for (ptrdiff_t i = row.from; i < row.to; ++i) sum[i] = from == NULL ? 0.0 : from[k][PHI_SITE(i)];
            for (int l = 0; l < PHI_DIM; ++l) {
#if PHI_ADJOINT
                const int entry = s->side != NULL ? l * PHI_DIM + k : k * PHI_DIM + l;
#else
                const int entry = k * PHI_DIM + l;
#endif
                const double *one = PHI_HERE(v[l]), *by = PHI_HERE(s->block[entry]);
                PHI_EACH_SITE
                for (ptrdiff_t i = row.from; i < row.to; ++i) sum[i] += by[i] * one[i];
            }
            PHI_COPY_ENDS(sum, s->length, row.from, row.to)
        }
    }
}

#endif
/* to = from - what solves matrix(v) = s->space[0], as well as a space of so many directions allows: GMRES, after Y. Saad
   and M. H. Schultz, without a restart. The matrix is that of phi_multiply. The length of s->space[0]; not finite if this
   is of no use. */
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
