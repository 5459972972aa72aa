#ifndef PHI_FILE_ROWS
#define PHI_FILE_ROWS
#include <stdint.h>

#include "lattice.h"
#include "model.h"

/* ---- Rows of sites ---- */
/* A piece of a row, and what loops over its sites are told. */
typedef struct {
    const phi_solver *s;
    double *const *x;             /* see phi_solver */
#if !PHI_ONE_ROW
    const ptrdiff_t *at;          /* the row itself and those beside it, from the first row on */
#endif
    ptrdiff_t from, to;           /* its sites, to not among them */
#if PHI_SERIES
    double *const *start, *const *out; /* where a stage starts, and where what is computed goes; x is y there */
#endif
#if PHI_SERIES && PHI_SLOPES || PHI_TANGENT
    double *const *varied;        /* a variation of x */
#endif
#if PHI_ADJOINT
    double *const *bar, *const *handed; /* see phi_transpose */
#if PHI_TAKES
    double *const *given;         /* what sites beside have handed before */
#endif
#endif
#if PHI_GIVERS
    ptrdiff_t givers[PHI_LINES];  /* the rows that hand something to this one, where they have been found */
#endif
#if PHI_BY_COLOUR
    int chosen;                   /* the colour that a part of H belongs to */
#endif
#if PHI_OPEN && !PHI_ONE_ROW
    double present[PHI_WEIGHTS];  /* 1 for terms of H that are there as far as the other axes say, else 0 */
#if PHI_BESIDE
    int whole;                    /* whether all of them are */
#endif
#endif
#if PHI_SEAMS
    double window;                /* the first kind, see phi_solver, of those that terms begin on which move sites near seams */
#if !PHI_ONE_ROW
    int near;                     /* the other axes along which it is near a seam, as bits */
#endif
#endif
#if PHI_COLOURS
#if !PHI_ONE_ROW
    int colour;                   /* of the first site */
#endif
#if PHI_SWEPT
    int swept;                    /* that of the sites which are swept */
#endif
#endif
} phi_row;

/* Before a loop over sites: tells compilers that they are independent. */
#if defined(__clang__)
#define PHI_EACH_SITE _Pragma("clang loop vectorize(assume_safety)")
#pragma clang diagnostic ignored "-Wpass-failed"
#elif defined(__GNUC__)
#define PHI_EACH_SITE _Pragma("GCC ivdep")
#else
#define PHI_EACH_SITE
#endif

#if PHI_COLOURS
/* The first site of a colour in a row, from a given one on. */
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
#if PHI_HALO
/* The copies beside a row, of the ends that are among the sites from..to: of the other end, or mirrored at open ends,
   where terms that read them have weight 0. */
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

#endif
#if !PHI_ONE_ROW
/* The position of a row along all axes but the last. */
static inline void phi_place(const phi_solver *s, size_t index, ptrdiff_t place[PHI_AXES])
{
    place[PHI_AXES - 1] = 0;
    for (int a = PHI_AXES - 2; a >= 0; --a) {
        place[a] = (ptrdiff_t)(index % s->sizes[a]);
        index /= s->sizes[a];
    }
}

#endif
#if PHI_ONE_ROW
/* The whole row. */
static inline phi_row phi_row_of(const phi_solver *s)
#else
/* The row of that number, which is worked at in one go. */
static inline phi_row phi_piece_of(const phi_solver *s, size_t index)
#endif
{
    phi_row row;
    row.s = s;
    row.x = s->x;
#if !PHI_ONE_ROW
    row.at = s->lines + index * PHI_LINES;
#endif
    row.from = 0;
    row.to = s->length;
#if PHI_SERIES
    row.start = row.out = s->x;
#endif
#if PHI_ADJOINT
    row.bar = row.handed = NULL;
#if PHI_TAKES
    row.given = NULL;
#endif
#endif
#if PHI_BY_COLOUR
    row.chosen = 0;
#endif
#if PHI_SEAMS
    row.window = 0.0;
#endif
#if PHI_COLOURS
#if !PHI_ONE_ROW
    row.colour = 0;
#endif
#if PHI_SWEPT
    row.swept = 0;
#endif
#endif
#if !PHI_ONE_ROW && PHI_OPEN || !PHI_ONE_ROW && PHI_COLOURS
    ptrdiff_t place[PHI_AXES];
    phi_place(s, index, place);
#endif
#if !PHI_ONE_ROW && PHI_OPEN
#if PHI_BESIDE
    row.whole = 1;
#endif
    for (int k = 0; k < PHI_WEIGHTS; ++k) {
        int there = 1;
        for (int a = 0; a < PHI_AXES - 1; ++a)
            there = there && place[a] + phi_weights[k][a][0] >= 0 &&
                place[a] + phi_weights[k][a][1] < (ptrdiff_t)s->sizes[a];
        row.present[k] = there ? 1.0 : 0.0;
#if PHI_BESIDE
        row.whole = row.whole && there;
#endif
    }
#endif
#if !PHI_ONE_ROW && PHI_COLOURS
    for (int a = 0; a < PHI_AXES - 1; ++a) row.colour = (int)((row.colour + place[a] * phi_colours[a]) % PHI_COLOUR_COUNT);
#endif
#if !PHI_ONE_ROW && PHI_SEAMS
    row.near = 0;
    for (int a = 0; a < PHI_AXES - 1; ++a) {
        const ptrdiff_t near = s->seams[a] < (ptrdiff_t)s->sizes[a] ? phi_seams[a][2] : 0;
        if (place[a] < near || place[a] >= s->seams[a] - near) row.near |= 1 << a;
    }
#endif
    return row;
}

#if PHI_ONE_ROW
#if PHI_GATHER
enum { PHI_PIECE = 256 }; /* sites that are worked at in one go, with any number of threads */
#else
enum { PHI_PIECE = 1024 }; /* sites that are worked at in one go, with any number of threads */
#endif

/* The pieces of the row; the last is the longest, so that no copied end reaches into another. */
static size_t phi_units(const phi_solver *s)
{
    return s->length < 2 * PHI_PIECE ? 1 : (size_t)s->length / PHI_PIECE;
}

/* The piece of that number. */
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
#else
static size_t phi_units(const phi_solver *s) { return s->rows; } /* what is worked at in one go */
#endif
#if PHI_BETWEEN

#if PHI_ONE_ROW
/* The sites from one on, before another. */
#else
/* The sites from one on, before another: as far as to the end of the last vector of 8, which may lie in the copies beside a row,
   where these are made anew. */
#endif
static inline const phi_row *phi_between(phi_row *row, ptrdiff_t from, ptrdiff_t to)
{
    row->from = from;
    row->to = to;
    return row;
}
#endif
#if PHI_BANDED

/* Unknowns are numbered site by site. The matrix 1 - (what a sweep does to a variation of y) has a band; what couples the
   two ends of a ring lies outside. So the last sites are a border, all of them where there are few: of the blocks
   (A B; C D), A is a band, factorised with pivoting, B becomes A^-1 B, and D becomes D - C A^-1 B, factorised too. */
enum { PHI_FEW = 6 * PHI_REACH + 6, PHI_TALL = 3 * PHI_BAND + 1 };

typedef struct {
    ptrdiff_t inner, border; /* unknowns */
    double *a, *b, *c, *d;   /* by columns; a is banded: entry (i, j) is in row 2 PHI_BAND + i - j */
    double *side;            /* a right-hand side, in both */
    double *pivots;          /* of A, then of D: the rows that were swapped */
} phi_matrix;

/* Where the parts are, and the doubles that they take. */
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
#endif
#endif
