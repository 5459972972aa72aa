#ifndef PHI_FILE_LATTICE_MATRIX
#define PHI_FILE_LATTICE_MATRIX
#include "lattice.h"
#include "model.h"

/* The Newton matrix 1 - (derivative of a sweep by y), with unknowns numbered site by site. It is banded, except for
   entries that couple the two ends of a ring. So the last sites form a border, and the matrix has blocks (A B; C D); in
   small lattices all sites are in the border. The memory holds the LU factors of the banded A, then A^-1 B in place of
   B, and the LU factors of D - C A^-1 B in place of D. */
enum { PHI_FEW = 6 * PHI_REACH + 6, PHI_TALL = 3 * PHI_BAND + 1 };

typedef struct {
    ptrdiff_t inner, border; /* numbers of unknowns, which are the numbers of rows of A and of D */
    double *a, *b, *c, *d;   /* the blocks by columns; entry (i, j) of A is in row 2 PHI_BAND + i - j of a */
    double *side;            /* right-hand side, then solution: inner unknowns, then those of the border */
    double *pivots;          /* exchanged rows of A, then of D */
} phi_matrix;

/* Set the sizes of *m and, unless `memory` is NULL, its pointers; returns the number of doubles in `memory`. */
static size_t phi_matrix_of(size_t sites, double *memory, phi_matrix *m)
{
    const size_t few = sites <= PHI_FEW ? sites : phi_open[0] ? 0 : PHI_REACH;
    const size_t border = few * PHI_DIM, inner = sites * PHI_DIM - border;
    const size_t sizes[] = { PHI_TALL * inner, inner * border, inner * border, border * border, inner + border };
    double **const parts[] = { &m->a, &m->b, &m->c, &m->d, &m->side };
    size_t total = 0;
    for (int k = 0; k < 5; total += sizes[k++])
        if (memory != NULL) *parts[k] = memory + total;
    if (memory != NULL) m->pivots = memory + total;
    m->inner = (ptrdiff_t)inner;
    m->border = (ptrdiff_t)border;
    return total + inner + border;
}

static size_t phi_matrix_size(size_t sites)
{
    phi_matrix matrix;
    return phi_matrix_of(sites, NULL, &matrix);
}

static void phi_place_matrix(phi_solver *s, double *memory) { s->matrix = memory; }
#endif
