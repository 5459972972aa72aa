#ifndef PHI_FILE_LATTICE_SITE_BLOCKS
#define PHI_FILE_LATTICE_SITE_BLOCKS
#include "lattice.h"
#include "model.h"

/* Replace a matrix by its inverse, or by the identity if it is singular. */
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

/* Compute the preconditioner at s->y[now]: the inverse of the diagonal block of each site. The preconditioner halves
   the number of Krylov directions where fields of one site are strongly coupled, like a field and its momentum. */
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

/* Compute `to` = `from` + (preconditioner) v; `from` may be NULL for 0. */
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
