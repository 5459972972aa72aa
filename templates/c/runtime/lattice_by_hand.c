#ifndef PHI_FILE_LATTICE_BY_HAND
#define PHI_FILE_LATTICE_BY_HAND
#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "sweeps.h"

/* ---- Caller-driven stepping ---- */
#if PHI_NOISE
/* Number of stages that callers can make: the stages of a step. */
enum { PHI_NUMBERED = PHI_FLOWS };
#else
/* Number of stages that callers can make: the stages of a step, and one that merges the last stage of a step with the
   first stage of the next step. */
enum { PHI_NUMBERED = PHI_FLOWS + 1 };
#endif

size_t phi_stages(void) { return PHI_FLOWS; }

phi_status phi_describe(size_t number, phi_stage *about)
{
    if (number >= PHI_NUMBERED || about == NULL) return PHI_BAD_ARGUMENT;
    *about = phi_stages_of[phi_flow_parts[number] - 1];
    return PHI_OK;
}

phi_status phi_begin(phi_solver *s, double h) { return phi_set_step(s, h); }

/* Number of rows in a plane. */
static size_t phi_rows_of_plane(const phi_solver *s) { return s->rows / s->sizes[0]; }

phi_status phi_sweep(phi_solver *s, size_t number, int full_range, size_t from, size_t to)
{
    if (s == NULL || !s->prepared || number >= PHI_NUMBERED || from > to || to > s->sizes[0]) return PHI_BAD_ARGUMENT;
#if !PHI_NEAR
    (void)full_range;
#endif
    const int part = phi_flow_parts[number];
#if PHI_RENEWED
    double coef[PHI_ROW];
    phi_renew(s, (int)number, s->steps, coef);
#else
    const double *coef = s->coef + number * PHI_ROW;
#endif
#if PHI_ONE_ROW
    const size_t units = phi_units(s);
#else
    const size_t units = phi_rows_of_plane(s);
#endif
    s->open = 0;
#if PHI_NOISE
    const int drawing = number == 0 || number == PHI_FLOWS - (int)PHI_SOURCES;
#endif
#if PHI_ONE_ROW
    s->from = (ptrdiff_t)from;
    s->to = (ptrdiff_t)to;
#if PHI_NOISE
    if (drawing) phi_draw_pieces(s, s->steps, number > 0, 0, units);
#endif
    phi_sweep_rows(s, part, coef PHI_AND_FULL_RANGE(full_range), 0, units);
    s->from = 0;
    s->to = s->length;
#if PHI_HALO
    for (size_t k = 0; k < PHI_DIM; ++k) phi_ends(s->x[k], s->length, 0, s->length);
#endif
#else
#if PHI_NOISE
    if (drawing) phi_draw_pieces(s, s->steps, number > 0, from * units, to * units);
#endif
    phi_sweep_rows(s, part, coef PHI_AND_FULL_RANGE(full_range), from * units, to * units);
#endif
    return PHI_OK;
}

phi_status phi_planes(const phi_solver *s, size_t field, size_t from, size_t to, double *x)
{
    if (s == NULL || x == NULL || field >= PHI_DIM || from > to || to > s->sizes[0]) return PHI_BAD_ARGUMENT;
#if PHI_ONE_ROW
    memcpy(x, s->x[field] + from, (to - from) * sizeof *x);
#else
    const size_t rows = phi_rows_of_plane(s), length = (size_t)s->length;
    for (size_t r = from * rows; r < to * rows; ++r, x += length) memcpy(x, PHI_ROW_AT(s->x[field]), length * sizeof *x);
#endif
    return PHI_OK;
}

phi_status phi_put_planes(phi_solver *s, size_t field, size_t from, size_t to, const double *x)
{
    if (s == NULL || x == NULL || field >= PHI_DIM || from > to || to > s->sizes[0]) return PHI_BAD_ARGUMENT;
    s->open = 0;
#if PHI_ONE_ROW
    memcpy(s->x[field] + from, x, (to - from) * sizeof *x);
    PHI_COPY_ENDS(s->x[field], s->length, 0, s->length)
#else
    const size_t rows = phi_rows_of_plane(s), length = (size_t)s->length;
    for (size_t r = from * rows; r < to * rows; ++r, x += length) {
        double *row = PHI_ROW_AT(s->x[field]);
        memcpy(row, x, length * sizeof *x);
        PHI_COPY_ENDS(row, s->length, 0, s->length)
    }
#endif
    return PHI_OK;
}

int phi_holds(const phi_solver *s, size_t from, size_t to)
{
    if (s == NULL || from > to || to > s->sizes[0]) return 0;
#if PHI_ONE_ROW
    for (size_t k = 0; k < PHI_DIM; ++k)
        if (!phi_finite(s->x[k] + from, to - from)) return 0;
#else
    for (size_t k = 0; k < PHI_DIM; ++k)
        for (size_t r = from * phi_rows_of_plane(s); r < to * phi_rows_of_plane(s); ++r)
            if (!phi_finite(s->x[k] + (ptrdiff_t)r * s->width, (size_t)s->length)) return 0;
#endif
    return 1;
}
#endif
