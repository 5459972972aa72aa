#ifndef PHI_FILE_ROWS_SINGLE
#define PHI_FILE_ROWS_SINGLE
#include "lattice.h"
#include "model.h"

/* Set the padded length of the only row. Returns 1, the number of rows, or 0 if the size is not allowed. */
static size_t phi_shape(const size_t sizes[PHI_AXES], ptrdiff_t *width)
{
    const size_t n = sizes != NULL ? sizes[0] : 0;
    if (n < phi_least[0] PHI_OR_MISFIT(0) || n > SIZE_MAX / 128 / PHI_DOUBLES_OF_SITE) return 0;
    const size_t wide = PHI_WIDE((n + 7) / 8 * 8);
    *width = (ptrdiff_t)(wide % 512 == 0 ? wide + 8 : wide); /* multiples of 512 share cache sets */
    return 1;
}

/* The whole row as one segment. */
static inline phi_row phi_row_of(const phi_solver *s)
{
    phi_row row;
#include "state_row_begun.h"
    return row;
}

#if PHI_GATHER
enum { PHI_PIECE = 256 }; /* number of sites in a segment of the row */
#else
enum { PHI_PIECE = 1024 }; /* number of sites in a segment of the row */
#endif

/* Number of segments of the row. The last one also has the sites that are left over: no segment is short. */
static size_t phi_units(const phi_solver *s)
{
    return s->length < 2 * PHI_PIECE ? 1 : (size_t)s->length / PHI_PIECE;
}

/* Segment number `unit` of the row: the work item of a thread. */
static inline phi_row phi_piece_of(const phi_solver *s, size_t unit)
{
    phi_row row = phi_row_of(s);
    row.from = (ptrdiff_t)unit * PHI_PIECE;
    if (unit + 1 < phi_units(s)) row.to = row.from + PHI_PIECE;
#if PHI_BY_HAND
    if (row.from < s->from) row.from = s->from;
    if (row.to > s->to) row.to = s->to;
#endif
    return row;
}
#endif
