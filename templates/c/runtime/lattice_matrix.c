#ifndef PHI_FILE_LATTICE_MATRIX
#define PHI_FILE_LATTICE_MATRIX
#include "lattice.h"
#include "model.h"

/* Unknowns are numbered site by site. The matrix 1 - (derivative of a sweep) is banded, except for entries that couple
   the two ends of a ring. So the last sites form a border; small lattices are all border. Of the blocks (A B; C D), A
   is a band factorised with pivoting, B becomes A^-1 B, and D becomes D - C A^-1 B, factorised too. */
enum { PHI_FEW = 6 * PHI_REACH + 6, PHI_TALL = 3 * PHI_BAND + 1 };

typedef struct {
    ptrdiff_t inner, border; /* numbers of unknowns */
    double *a, *b, *c, *d;   /* by columns; a is banded: entry (i, j) is in row 2 PHI_BAND + i - j */
    double *side;            /* right-hand side: inner unknowns, then border */
    double *pivots;          /* swapped rows of A, then of D */
} phi_matrix;

/* Set the pointers of *m into memory, if not NULL; returns the number of doubles. */
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
