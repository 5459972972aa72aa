#ifndef PHI_FILE_ROWS_MANY
#define PHI_FILE_ROWS_MANY
#include "lattice.h"
#include "model.h"

/* Number of rows for these sizes, and their width; 0 if sizes are not allowed. */
static size_t phi_shape(const size_t sizes[PHI_AXES], ptrdiff_t *width)
{
    const size_t most = SIZE_MAX / 64 / PHI_DOUBLES_OF_SITE;
    size_t rows = 1;
    if (sizes == NULL) return 0;
    for (int a = 0; a < PHI_AXES; ++a)
        if (sizes[a] < phi_least[a] PHI_OR_MISFIT(a) || sizes[a] > most / 2) return 0;
    for (int a = 0; a < PHI_AXES - 1; ++a) {
        if (rows > most / sizes[a]) return 0;
        rows *= sizes[a];
    }
    size_t wide = PHI_WIDE((sizes[PHI_LAST_AXIS] + 7) / 8 * 8);
    if (wide % 512 == 0) wide += 8; /* multiples of 512 share cache sets */
    *width = (ptrdiff_t)wide;
    return rows > most / wide ? 0 : rows;
}

/* Compute the position of row number `index` along all axes but the last. */
static inline void phi_place(const phi_solver *s, size_t index, ptrdiff_t place[PHI_AXES])
{
    place[PHI_AXES - 1] = 0;
    for (int a = PHI_AXES - 2; a >= 0; --a) {
        place[a] = (ptrdiff_t)(index % s->sizes[a]);
        index /= s->sizes[a];
    }
}

/* Compute the offsets in memory of a row and its neighbours. */
static void phi_find_lines(const phi_solver *s, size_t index, ptrdiff_t at[PHI_LINES])
{
    ptrdiff_t place[PHI_AXES];
    phi_place(s, index, place);
    for (int k = 0; k < PHI_LINES; ++k) {
        ptrdiff_t line = 0;
        for (int a = 0; a < PHI_AXES - 1; ++a) {
            const ptrdiff_t size = (ptrdiff_t)s->sizes[a];
            ptrdiff_t p = place[a] + phi_lines[k][a];
            if (phi_open[a]) { /* rows beyond open ends are mirrored; their values have the weight 0 */
                p = p < 0 ? -p : p < size ? p : 2 * (size - 1) - p;
                p = p < 0 ? 0 : p < size ? p : size - 1;
            } else {
                p += (p < 0 ? size : 0) - (p >= size ? size : 0);
            }
            line = line * size + p;
        }
        at[k] = line * s->width;
    }
}

/* Store the offsets of all rows and of their neighbours in `memory`; s->lines points to them. */
static void phi_find_all_lines(phi_solver *s, double *memory)
{
    s->lines = (ptrdiff_t *)(void *)memory;
    for (size_t r = 0; r < s->rows; ++r) phi_find_lines(s, r, s->lines + r * PHI_LINES);
}

/* Row number `index`: the work item of a thread. */
static inline phi_row phi_piece_of(const phi_solver *s, size_t index)
{
    phi_row row;
#include "state_row_begun.h"
#if PHI_OPEN || PHI_COLOURS
    ptrdiff_t place[PHI_AXES];
    phi_place(s, index, place);
#endif
#if PHI_OPEN
#if PHI_BESIDE
    row.complete = 1;
#endif
    for (int k = 0; k < PHI_WEIGHTS; ++k) {
        int there = 1;
        for (int a = 0; a < PHI_AXES - 1; ++a)
            there = there && place[a] + phi_weights[k][a][0] >= 0 &&
                place[a] + phi_weights[k][a][1] < (ptrdiff_t)s->sizes[a];
        row.present[k] = there ? 1.0 : 0.0;
#if PHI_BESIDE
        row.complete = row.complete && there;
#endif
    }
#endif
#if PHI_COLOURS
    for (int a = 0; a < PHI_AXES - 1; ++a) row.colour = (int)((row.colour + place[a] * phi_colours[a]) % PHI_COLOUR_COUNT);
#endif
#if PHI_SEAMS
    row.near_seams = 0;
    for (int a = 0; a < PHI_AXES - 1; ++a) {
        const ptrdiff_t width = s->seams[a] < (ptrdiff_t)s->sizes[a] ? phi_seams[a][2] : 0;
        if (place[a] < width || place[a] >= s->seams[a] - width) row.near_seams |= 1 << a;
    }
#endif
    return row;
}

static size_t phi_units(const phi_solver *s) { return s->rows; } /* number of work items for threads: the rows */
#endif
