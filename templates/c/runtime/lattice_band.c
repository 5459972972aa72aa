#ifndef PHI_FILE_LATTICE_BAND
#define PHI_FILE_LATTICE_BAND
#include <math.h>
#include <string.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "sweeps.h"

/* ---- Elimination in a band ---- */
static void phi_swap(double *a, double *b)
{
    const double held = *a;
    *a = *b;
    *b = held;
}

/* Index of the entry with the largest magnitude. */
static ptrdiff_t phi_largest(const double *entries, ptrdiff_t count)
{
    ptrdiff_t pivot = 0;
    for (ptrdiff_t k = 1; k < count; ++k)
        if (fabs(entries[k]) > fabs(entries[pivot])) pivot = k;
    return pivot;
}

/* Replace a band matrix, or with middle < 0 a full matrix, by its LU factors, with row exchanges. Columns are `tall`
   apart, with at most `below` entries under the diagonal. `pivots` receives the exchanged rows. Returns 0 if singular.
   */
static int phi_decompose(double *a, ptrdiff_t n, ptrdiff_t tall, ptrdiff_t middle, ptrdiff_t below, double *pivots)
{
    ptrdiff_t last = 0;
    for (ptrdiff_t j = 0; j < n; ++j) { /* entry (i, j) is a[j * tall + middle + i - j], or a[j * tall + i] in a full matrix */
        const ptrdiff_t under = n - 1 - j < below ? n - 1 - j : below, step = middle < 0 ? tall : tall - 1;
        double *diagonal = a + j * tall + (middle < 0 ? j : middle);
        const ptrdiff_t p = phi_largest(diagonal, under + 1);
        pivots[j] = (double)p;
        if (!(fabs(diagonal[p]) > 0.0)) return 0;
        const ptrdiff_t reach = middle < 0 ? n - 1 : j + p + below < n - 1 ? j + p + below : n - 1;
        last = reach > last ? reach : last;
        for (ptrdiff_t k = j; p != 0 && k <= last; ++k) phi_swap(diagonal + (k - j) * step, diagonal + p + (k - j) * step);
        for (ptrdiff_t i = 1; i <= under; ++i) diagonal[i] /= *diagonal;
        for (ptrdiff_t k = j + 1; k <= last; ++k) {
            double *entry = diagonal + (k - j) * step;
            for (ptrdiff_t i = 1; i <= under; ++i) entry[i] -= diagonal[i] * *entry;
        }
    }
    return 1;
}

/* Solve a linear system by the factors of phi_decompose; x is the right-hand side, and becomes the solution. */
static void phi_substitute(
    const double *a, ptrdiff_t n, ptrdiff_t tall, ptrdiff_t middle, ptrdiff_t below, const double *pivots, double *x)
{
    for (ptrdiff_t j = 0; j < n; ++j) {
        const ptrdiff_t under = n - 1 - j < below ? n - 1 - j : below;
        const double *diagonal = a + j * tall + (middle < 0 ? j : middle);
        if (pivots[j] > 0.0) phi_swap(x + j, x + j + (ptrdiff_t)pivots[j]);
        for (ptrdiff_t i = 1; i <= under; ++i) x[j + i] -= diagonal[i] * x[j];
    }
    for (ptrdiff_t j = n - 1; j >= 0; --j) {
        const ptrdiff_t over = middle < 0 || j < middle ? j : middle;
        const double *diagonal = a + j * tall + (middle < 0 ? j : middle);
        x[j] /= *diagonal;
        for (ptrdiff_t i = 1; i <= over; ++i) x[j - i] -= diagonal[-i] * x[j];
    }
}

static void phi_put_entry(const phi_matrix *m, ptrdiff_t i, ptrdiff_t j, double value)
{
    if (i < m->inner && j < m->inner)
        m->a[j * PHI_TALL + 2 * PHI_BAND + i - j] = value;
    else if (i < m->inner)
        m->b[(j - m->inner) * m->inner + i] = value;
    else if (j < m->inner)
        m->c[j * m->border + i - m->inner] = value;
    else
        m->d[(j - m->inner) * m->border + i - m->inner] = value;
}

/* Compute some columns of the Newton matrix, by one product of the derivative of a sweep with a vector. They belong to
   field f at `count` sites from `first` on. The sites are so far apart that their columns do not overlap. */
static void phi_probe(phi_solver *s, const phi_matrix *m, const double *coef, int now, ptrdiff_t first, ptrdiff_t count, int f)
{
    const ptrdiff_t sites = s->length, apart = 2 * PHI_REACH + 1;
    const ptrdiff_t reach = sites < apart ? sites / 2 : (ptrdiff_t)PHI_REACH;
    for (int k = 0; k < PHI_DIM; ++k) {
        for (ptrdiff_t i = PHI_LEAST_COPY; i < PHI_AND_COPIES(sites); ++i) s->v[k][i] = 0.0;
        for (ptrdiff_t i = 0; k == f && i < count; ++i) s->v[k][first + i * apart] = 1.0;
        PHI_COPY_ENDS(s->v[k], sites, 0, sites)
    }
#if PHI_ADJOINT
    double *const *y = s->y[s->side != NULL ? 2 : now];
#else
    double *const *y = s->y[now];
#endif
    for (size_t unit = 0; unit < phi_units(s); ++unit) phi_slope_piece(s, coef, y, s->v, s->y[1 - now], unit);
    for (ptrdiff_t column = 0; column < count; ++column)
        for (ptrdiff_t o = -reach; o <= reach; ++o) {
            const ptrdiff_t j = first + column * apart;
            ptrdiff_t i = j + o;
            if (phi_open[0] && (i < 0 || i >= sites)) continue;
            i += (i < 0 ? sites : 0) - (i >= sites ? sites : 0);
            for (int k = 0; k < PHI_DIM; ++k)
                phi_put_entry(m, i * PHI_DIM + k, j * PHI_DIM + f, (i == j && k == f ? 1.0 : 0.0) - s->y[1 - now][k][i]);
        }
}

/* Compute and factorise the Newton matrix at s->y[now]. Returns 0 if it is singular. */
static int phi_factorise(phi_solver *s, const double *coef, int now)
{
    phi_matrix m;
    const size_t entries = phi_matrix_of(s->sites, s->matrix, &m);
    const ptrdiff_t sites = s->length, apart = 2 * PHI_REACH + 1, full_periods = sites / apart, inner = m.inner, border = m.border;
    memset(s->matrix, 0, entries * sizeof *s->matrix);
    for (int f = 0; f < PHI_DIM; ++f) {
        for (ptrdiff_t first = 0; full_periods > 0 && first < apart; ++first) phi_probe(s, &m, coef, now, first, full_periods, f);
        for (ptrdiff_t i = full_periods * apart; i < sites; ++i) phi_probe(s, &m, coef, now, i, 1, f);
    }
    if (!phi_decompose(m.a, inner, PHI_TALL, 2 * PHI_BAND, PHI_BAND, m.pivots)) return 0;
    for (ptrdiff_t j = 0; j < border; ++j) {
        double *b = m.b + j * inner, *d = m.d + j * border;
        phi_substitute(m.a, inner, PHI_TALL, 2 * PHI_BAND, PHI_BAND, m.pivots, b);
        for (ptrdiff_t k = 0; k < inner; ++k)
            for (ptrdiff_t i = 0; i < border; ++i) d[i] -= m.c[k * border + i] * b[k];
    }
    return phi_decompose(m.d, border, border, -1, border, m.pivots + inner);
}

/* Solve a linear system with the factorised Newton matrix; m->side becomes the solution. */
static void phi_solve(const phi_matrix *m)
{
    const ptrdiff_t inner = m->inner, border = m->border;
    double *lower = m->side + inner;
    phi_substitute(m->a, inner, PHI_TALL, 2 * PHI_BAND, PHI_BAND, m->pivots, m->side);
    for (ptrdiff_t k = 0; k < inner; ++k)
        for (ptrdiff_t i = 0; i < border; ++i) lower[i] -= m->c[k * border + i] * m->side[k];
    phi_substitute(m->d, border, border, -1, border, m->pivots + inner, lower);
    for (ptrdiff_t j = 0; j < border; ++j)
        for (ptrdiff_t i = 0; i < inner; ++i) m->side[i] -= m->b[j * inner + i] * lower[j];
}

/* Solve the transposed linear system by the factors of phi_decompose; x is the right-hand side, and becomes the solution. */
static void phi_substitute_back(
    const double *a, ptrdiff_t n, ptrdiff_t tall, ptrdiff_t middle, ptrdiff_t below, const double *pivots, double *x)
{
    for (ptrdiff_t j = 0; j < n; ++j) {
        const ptrdiff_t over = middle < 0 || j < middle ? j : middle;
        const double *diagonal = a + j * tall + (middle < 0 ? j : middle);
        for (ptrdiff_t i = 1; i <= over; ++i) x[j] -= diagonal[-i] * x[j - i];
        x[j] /= *diagonal;
    }
    for (ptrdiff_t j = n - 1; j >= 0; --j) {
        const ptrdiff_t under = n - 1 - j < below ? n - 1 - j : below;
        const double *diagonal = a + j * tall + (middle < 0 ? j : middle);
        for (ptrdiff_t i = 1; i <= under; ++i) x[j] -= diagonal[i] * x[j + i];
        if (pivots[j] > 0.0) phi_swap(x + j, x + j + (ptrdiff_t)pivots[j]);
    }
}

/* Solve the transposed linear system with the factorised Newton matrix; m->side becomes the solution. The blocks are used
   in the order A^-1 B, D, C, A. */
static void phi_solve_back(const phi_matrix *m)
{
    const ptrdiff_t inner = m->inner, border = m->border;
    double *lower = m->side + inner;
    for (ptrdiff_t j = 0; j < border; ++j)
        for (ptrdiff_t i = 0; i < inner; ++i) lower[j] -= m->b[j * inner + i] * m->side[i];
    phi_substitute_back(m->d, border, border, -1, border, m->pivots + inner, lower);
    for (ptrdiff_t k = 0; k < inner; ++k)
        for (ptrdiff_t i = 0; i < border; ++i) m->side[k] -= m->c[k * border + i] * lower[i];
    phi_substitute_back(m->a, inner, PHI_TALL, 2 * PHI_BAND, PHI_BAND, m->pivots, m->side);
}

/* Make a Newton correction of s->y[now]. s->y[1 - now] is the result of a sweep; its difference from s->y[now] is the
   residual. Then the corrected y replaces this result. */
static void phi_eliminate(phi_solver *s, int now)
{
    phi_matrix m;
    phi_matrix_of(s->sites, s->matrix, &m);
    const ptrdiff_t sites = s->length;
    for (ptrdiff_t i = 0; i < sites; ++i)
        for (int k = 0; k < PHI_DIM; ++k) m.side[i * PHI_DIM + k] = s->y[1 - now][k][i] - s->y[now][k][i];
#if PHI_ADJOINT
    if (s->side != NULL) phi_solve_back(&m);
    else phi_solve(&m);
#else
    phi_solve(&m);
#endif
    for (int k = 0; k < PHI_DIM; ++k) {
        for (ptrdiff_t i = 0; i < sites; ++i) s->y[1 - now][k][i] = s->y[now][k][i] + m.side[i * PHI_DIM + k];
        PHI_COPY_ENDS(s->y[1 - now][k], sites, 0, sites)
    }
}
#endif
