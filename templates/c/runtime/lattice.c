#ifndef PHI_FILE_LATTICE
#define PHI_FILE_LATTICE
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "lane_functions.c"
#include "sweeps.h"
#include "graph.c"
#include "lattice_noise.c"

/* ---- The lattice ---- */
#include "start_policy.h"
#include "lattice_pieces.c"
#include "lattice_share.c"

enum { PHI_BUFFER = 256 }; /* number of densities that are stored before they are summed */

#if PHI_SPREAD
/* Number of doubles from one array to the next. Arrays start at different offsets in memory pages, since a load would wait
   for a pending store with the same offset. */
static size_t phi_block(size_t rows, ptrdiff_t width)
{
    const size_t block = rows * (size_t)width, apart = 512 / PHI_ARRAYS / 8 * 8;
    return block < 512 ? block : block + (512 + apart - block % 512) % 512;
}
#else
/* Number of doubles from one array to the next. */
static size_t phi_block(size_t rows, ptrdiff_t width) { return rows * (size_t)width; }
#endif

size_t phi_work_size(PHI_SIZES_OF_WORK)
{
    ptrdiff_t width;
    const size_t rows = phi_shape(sizes, &width);
    if (rows == 0 PHI_OR_TOO_MANY(sizes[0])) return 0;
    const size_t doubles = PHI_RESERVED * phi_block(rows, width) PHI_AND_MATRIX(sizes[0]);
    return doubles * sizeof(double) PHI_AND_TABLES + 64;
}

/* Copy values of sites, the last axis fastest, into rows. */
static void phi_put(const phi_solver *s, double *rows, const double *values)
{
    memset(PHI_MEMORY_OF(rows), 0, s->rows * (size_t)s->width * sizeof *rows);
    PHI_EACH_ROW {
        memcpy(PHI_ROW_AT(rows), PHI_VALUES_AT(values), (size_t)s->length * sizeof *rows);
        PHI_COPY_ENDS(PHI_ROW_AT(rows), s->length, 0, s->length)
    }
}

/* Copy fields to x[field][site], without the halo. */
static void phi_take(const phi_solver *s, double *const *fields, double *x)
{
    for (size_t k = 0; k < PHI_DIM; ++k)
        PHI_EACH_ROW
            memcpy(PHI_VALUES_AT(x + k * s->sites), PHI_ROW_AT(fields[k]), (size_t)s->length * sizeof *x);
}

#include "lattice_seams.c"

/* Store a parameter at all sites: the array `values`, or `value` at each site if `values` is NULL. */
static void phi_put_parameter(const phi_solver *s, double *rows, const double *values, double value)
{
    for (ptrdiff_t i = PHI_LEAST; i < PHI_MEMORY_OF(PHI_BEYOND); ++i) rows[i] = value;
    if (values != NULL) phi_put(s, rows, values);
}

#include "parameters.h"
/* ---- The solver ---- */
static void phi_prepare_step(const phi_params *params, double h, double *coef)
{
#if PHI_KICKS
    for (int k = 0; k < PHI_ROWS_OF_FLOWS; ++k) {
        const double kick[1] = { phi_multiples[k] * (h * h) };
        phi_prepare(params, phi_times[k] * h, kick, coef + k * PHI_ROW);
    }
#else
    for (int k = 0; k < PHI_ROWS_OF_FLOWS; ++k) phi_prepare(params, phi_times[k] * h PHI_AND_ON_TIME, coef + k * PHI_ROW);
#endif
}

static int phi_finite(const double *values, size_t count)
{
    int finite = 1;
    for (size_t k = 0; k < count; ++k) finite &= isfinite(values[k]) != 0;
    return finite;
}

#include "lattice_carry.c"
#include "lattice_bodies.c"
#include "lattice_monitor.c"

phi_status PHI_INIT(phi_solver *s, const phi_params *params, PHI_SIZES, const double *x0 PHI_AND_T0, void *work)
{
    ptrdiff_t width;
    if (s == NULL || sizes == NULL || x0 == NULL || work == NULL PHI_OR_NO_T0) return PHI_BAD_ARGUMENT;
    const phi_params values = params != NULL ? *params : phi_default_params;
    const size_t rows = phi_shape(sizes, &width), length = sizes[PHI_LAST_AXIS], sites = rows * length;
    if (rows == 0 PHI_OR_UNCONNECTED(sites) || !phi_allowed(&values, sites PHI_AND_BONDS)) return PHI_BAD_ARGUMENT;
    if (!phi_finite(x0, PHI_DIM * sites)) return PHI_BAD_ARGUMENT;
    double coef[PHI_COEFFICIENTS] = { 0.0 };
    phi_prepare_step(&values, PHI_PROBE_STEP, coef);
    if (!phi_finite(coef, PHI_COEFFICIENTS)) return PHI_BAD_ARGUMENT;
    memset(s, 0, sizeof *s);
    memcpy(s->sizes, sizes, sizeof s->sizes);
    s->sites = sites;
    s->rows = rows;
    s->length = (ptrdiff_t)length;
    s->width = width;
    PHI_TAKE_T0
    s->params = values;
    phi_find_seams(s);
    double *memory = PHI_FIRST_SITE((double *)(void *)((char *)work + (64 - (uintptr_t)work % 64) % 64));
    const size_t block = phi_block(rows, width);
    phi_find_all_lines(s, PHI_MEMORY_OF(memory) + PHI_RESERVED * block);
    phi_place_matrix(s, PHI_MEMORY_OF(memory) + PHI_RESERVED * block);
    phi_connect(s, bonds, PHI_MEMORY_OF(memory) + PHI_RESERVED * block);
#include "state_placed.h"
    for (size_t k = 0; k < PHI_DIM; ++k) phi_put(s, s->x[k], x0 + k * sites);
    phi_clear_carry(s);
    phi_put_kinds(s);
    phi_put_parameters(s, &values);
    phi_put_at_bonds(s, &values);
#if PHI_BODIES
    if (!phi_weigh(s)) return PHI_BAD_ARGUMENT;
#endif
#if PHI_MONITOR
    memset(s->clock, 0, 4 * sizeof *s->clock);
    if (!phi_take_level(s)) return PHI_BAD_ARGUMENT;
#endif
    return PHI_OK;
}

#include "lattice_time.c"

/* Compute the coefficients for steps of size h, if h has changed. */
static phi_status phi_set_step(phi_solver *s, double h)
{
    if (s == NULL || !isfinite(h)) return PHI_BAD_ARGUMENT;
    if (s->prepared && h == s->h) return PHI_OK;
    PHI_NOT_OPEN(s)
    phi_prepare_step(&s->params, h, s->coef);
    s->h = h;
#if !PHI_MONITOR
    s->t_before_h = s->t;
    s->steps_before_h = s->steps;
#endif
    s->prepared = 1;
    return PHI_OK;
}

#include "lattice_passed.c"
#include "lattice_renewed.c"

/* Whether the fields are finite at all sites. */
static int phi_all_hold(const phi_solver *s, double *const *x)
{
    for (size_t k = 0; k < PHI_DIM; ++k)
        PHI_EACH_ROW
            if (!phi_finite(PHI_ROW_AT(x[k]), (size_t)s->length)) return 0;
    return 1;
}

/* Copy fields with their halo. */
static void phi_copy(double *const *to, double *const *from, const phi_solver *s)
{
    for (size_t k = 0; k < PHI_DIM; ++k) memcpy(PHI_MEMORY_OF(to[k]), PHI_MEMORY_OF(from[k]), PHI_DOUBLES * sizeof **from);
    phi_copy_carry(s, to);
    phi_copy_clock(s, to);
}

#include "lattice_vectors.c"

#include "lattice_stages.c"
#include "lattice_flows.c"

phi_status phi_step(phi_solver *s, double h) { return phi_integrate(s, h, 1); }

void phi_state(const phi_solver *s, double *x) { phi_take(s, s->x, x); }

#include "lattice_kicks.c"
#include "lattice_parameters.c"
#include "lattice_clock.c"

#include "lattice_tangent.c"

#include "lattice_adjoint.c"

#include "lattice_saved.c"
#include "lattice_saved_compensated.c"
#include "lattice_saved_noise.c"

/* ---- Observables ---- */
double phi_hamiltonian(const phi_solver *s)
{
    double density[PHI_BUFFER], sum = 0.0, rest = 0.0;
    PHI_EACH_ROW {
        phi_row row = PHI_WHOLE_ROW;
        for (; row.from < s->length; row.from = row.to) {
            row.to = s->length - row.from > PHI_BUFFER ? row.from + PHI_BUFFER : s->length;
            phi_energy_row(&row, density);
            for (ptrdiff_t i = 0; i < row.to - row.from; ++i) { /* compensated summation after A. Neumaier */
                const double total = sum + density[i];
                rest += fabs(sum) >= fabs(density[i]) ? (sum - total) + density[i] : (density[i] - total) + sum;
                sum = total;
            }
        }
    }
    return sum + rest;
}

void phi_density(const phi_solver *s, double *out)
{
    PHI_EACH_ROW {
        const phi_row row = PHI_WHOLE_ROW;
        phi_energy_row(&row, PHI_VALUES_AT(out));
    }
}

#if PHI_CASIMIRS
void phi_casimirs(const phi_solver *s, double *out)
{
    PHI_EACH_ROW {
        const phi_row row = PHI_WHOLE_ROW;
        phi_casimirs_row(&row, PHI_VALUES_AT(out));
    }
}
#else
void phi_casimirs(const phi_solver *s, double *out) { (void)s, (void)out; }
#endif

void phi_vector_field(const phi_solver *s, double *out)
{
    PHI_EACH_ROW {
        const phi_row row = PHI_WHOLE_ROW;
        phi_vector_field_row(&row, PHI_VALUES_AT(out));
    }
}

#include "lattice_observed.c"
#include "lattice_observed_fields.c"
#include "lattice_by_hand.c"
#include "status.c"

size_t phi_solver_size(void) { return sizeof(phi_solver); }

size_t phi_solver_steps_done(const phi_solver *s) { return s->steps; }

#endif
