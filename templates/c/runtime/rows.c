#ifndef PHI_FILE_ROWS
#define PHI_FILE_ROWS
#include <stdint.h>

#include "lattice.h"
#include "model.h"

/* ---- Rows of sites ---- */
/* A segment of a row, with the pointers and numbers that a loop over the sites of the segment reads. */
typedef struct {
#include "state_of_row.h"
} phi_row;

/* Stands before loops over sites: it tells the compiler that their iterations are independent. */
#if defined(__clang__)
#define PHI_EACH_SITE _Pragma("clang loop vectorize(assume_safety)")
#pragma clang diagnostic ignored "-Wpass-failed"
#elif defined(__GNUC__)
#define PHI_EACH_SITE _Pragma("GCC ivdep")
#else
#define PHI_EACH_SITE
#endif

#if PHI_COLOURS
/* First site of the colour in a row, from the site `from` on. */
static ptrdiff_t phi_first(const phi_row *row, int colour, ptrdiff_t from)
{
    for (ptrdiff_t i = from; i < from + PHI_COLOUR_COUNT; ++i)
#if PHI_ONE_ROW
        if ((int)(i % PHI_COLOUR_COUNT) * PHI_COLOUR_STRIDE % PHI_COLOUR_COUNT == colour) return i;
#else
        if ((row->colour + (int)(i % PHI_COLOUR_COUNT) * PHI_COLOUR_STRIDE) % PHI_COLOUR_COUNT == colour) return i;
#endif
    return row->to;
}

#endif
#if PHI_OPEN_ROWS
/* Update the halo, which mirrors the sites at open ends, after the sites `from` to `to` - 1 have changed. */
#else
/* Update the halo, copies of the sites at the opposite end, after the sites `from` to `to` - 1 have changed. */
#endif
static inline void phi_ends(double *row, ptrdiff_t length, ptrdiff_t from, ptrdiff_t to)
{
#if PHI_OPEN_ROWS
    for (ptrdiff_t k = 1; k <= PHI_HALO; ++k) {
        const ptrdiff_t inside = k < length ? k : length - 1;
        if (from == 0) row[-k] = row[inside];
        if (to == length) row[length - 1 + k] = row[length - 1 - inside];
    }
#else
    if (from == 0)
        for (ptrdiff_t k = 0; k < PHI_HALO; ++k) row[length + k] = row[k];
    if (to == length)
        for (ptrdiff_t k = 1; k <= PHI_HALO; ++k) row[-k] = row[length - k];
#endif
}

#include "rows_single.c"
#include "rows_many.c"

#if PHI_BETWEEN

#if PHI_ONE_ROW
/* Restrict a row to the sites i with from <= i < to, for a loop over them. */
#else
/* Restrict a row to the sites i with from <= i < to. Callers may round `to` up to a multiple of 8, for whole SIMD vectors.
   The sites that this adds lie in the halo, which is updated afterwards. */
#endif
static inline const phi_row *phi_between(phi_row *row, ptrdiff_t from, ptrdiff_t to)
{
    row->from = from;
    row->to = to;
    return row;
}
#endif
#include "lattice_matrix.c"
#endif
