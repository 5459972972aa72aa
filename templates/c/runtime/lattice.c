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
#if PHI_SERIES
/* Before a loop over pieces: they are worked at in parallel. */
#ifdef _OPENMP
#if PHI_PAIRS
#define PHI_EACH_PIECE _Pragma("omp parallel for if (s->sites > 512)")
#else
#define PHI_EACH_PIECE _Pragma("omp parallel for if (s->sites > 4096)")
#endif
#define PHI_ONE_BY_ONE _Pragma("omp critical")
#else
#define PHI_EACH_PIECE
#define PHI_ONE_BY_ONE
#endif

#endif
#if PHI_SHARED
#ifdef _OPENMP
#ifdef __cplusplus
extern "C" {
#endif
int omp_get_num_threads(void); /* as in omp.h, which compilers without OpenMP lack */
int omp_get_thread_num(void);
#ifdef __cplusplus
}
#endif
#if PHI_PAIRS
#define PHI_PARALLEL _Pragma("omp parallel if (s->sites > 512)")
#else
#define PHI_PARALLEL _Pragma("omp parallel if (s->sites > 4096)")
#endif
#define PHI_THREADS (size_t)omp_get_num_threads()
#define PHI_THREAD (size_t)omp_get_thread_num()
#else
#define PHI_PARALLEL
#define PHI_THREADS (size_t)1
#define PHI_THREAD (size_t)0
#endif

/* The part of so many units that a thread works at, from *first on; returns its end. */
static size_t phi_share(size_t units, size_t *first)
{
    const size_t threads = PHI_THREADS, own = PHI_THREAD, each = units / threads, more = units % threads;
    *first = each * own + (own < more ? own : more);
    return *first + each + (own < more);
}

#if PHI_HANDS || !PHI_SERIES
/* Until all threads are here. */
static void phi_wait(void)
{
#ifdef _OPENMP
    if (PHI_THREADS > 1) { /* of one thread, too, a barrier may ask the operating system to wake the others */
#pragma omp barrier
    }
#endif
}

#endif
#endif
#if !PHI_SERIES
enum { PHI_STRETCH = 32 }; /* steps between looks at the state: what is not finite stays so */
#if PHI_NEAR
enum { PHI_FAR_STEPS = 64 }; /* steps by functions for large arguments, after one that needed them */
#endif
#endif
enum { PHI_BUFFER = 256 }; /* densities that are added in one go */

/* The number of rows for such sizes, and their width; 0 if the sizes are not allowed. */
static size_t phi_shape(const size_t sizes[PHI_AXES], ptrdiff_t *width)
{
#if PHI_BANDED
    const size_t most = SIZE_MAX / 64 / (PHI_RESERVED + 8 * PHI_BAND * PHI_DIM);
#else
    const size_t most = SIZE_MAX / 64 / PHI_RESERVED;
#endif
#if PHI_ONE_ROW
#if PHI_PERIODIC_COLOURS
    if (sizes == NULL || sizes[0] < phi_least[0] || sizes[0] % phi_periods[0] != 0 || sizes[0] > most / 2) return 0;
#else
    if (sizes == NULL || sizes[0] < phi_least[0] || sizes[0] > most / 2) return 0;
#endif
#else
    size_t rows = 1;
    if (sizes == NULL) return 0;
    for (int a = 0; a < PHI_AXES; ++a)
#if PHI_PERIODIC_COLOURS
        if (sizes[a] < phi_least[a] || sizes[a] % phi_periods[a] != 0 || sizes[a] > most / 2) return 0;
#else
        if (sizes[a] < phi_least[a] || sizes[a] > most / 2) return 0;
#endif
    for (int a = 0; a < PHI_AXES - 1; ++a) {
        if (rows > most / sizes[a]) return 0;
        rows *= sizes[a];
    }
#endif
#if PHI_HALO
    size_t wide = PHI_LEAD + ((sizes[PHI_LAST_AXIS] + 7) / 8 * 8 + PHI_HALO + 7) / 8 * 8;
#else
    size_t wide = (sizes[PHI_LAST_AXIS] + 7) / 8 * 8;
#endif
    if (wide % 512 == 0) wide += 8; /* rows a multiple of a page apart would share lines of the cache */
    *width = (ptrdiff_t)wide;
#if PHI_ONE_ROW
    return 1;
#else
    return rows > most / wide ? 0 : rows;
#endif
}

#if PHI_SPREAD
/* Doubles from one array to the next. The values of a site are far apart in their pages: reading waits for what is being
   written at the same place of another page. */
static size_t phi_block(size_t rows, ptrdiff_t width)
{
    const size_t block = rows * (size_t)width, apart = 512 / PHI_ARRAYS / 8 * 8;
    return block < 512 ? block : block + (512 + apart - block % 512) % 512;
}
#else
/* Doubles from one array to the next. */
static size_t phi_block(size_t rows, ptrdiff_t width) { return rows * (size_t)width; }
#endif

#if PHI_GRAPH
size_t phi_work_size(const size_t sizes[PHI_AXES], size_t bonds)
#else
size_t phi_work_size(const size_t sizes[PHI_AXES])
#endif
{
    ptrdiff_t width;
    const size_t rows = phi_shape(sizes, &width);
#if PHI_GRAPH
    if (rows == 0 || !phi_few(sizes[0], bonds)) return 0;
#else
    if (rows == 0) return 0;
#endif
    size_t doubles = PHI_RESERVED * phi_block(rows, width);
#if PHI_BANDED
    phi_matrix matrix;
    doubles += phi_matrix_of(sizes[0], NULL, &matrix);
#endif
#if PHI_GRAPH
    return doubles * sizeof(double) + phi_graph_size(sizes[0], bonds) + 64;
#else
#if PHI_ONE_ROW
    return doubles * sizeof(double) + 64;
#else
    return doubles * sizeof(double) + rows * PHI_LINES * sizeof(ptrdiff_t) + 64;
#endif
#endif
}

/* Values of sites, the last axis fastest, into rows. */
static void phi_put(const phi_solver *s, double *rows, const double *values)
{
    PHI_EACH_ROW {
#if PHI_HALO
        double *row = PHI_ROW_AT(rows);
        memset(PHI_MEMORY_OF(row), 0, (size_t)s->width * sizeof *row);
        memcpy(row, PHI_VALUES_AT(values), (size_t)s->length * sizeof *row);
        phi_ends(row, s->length, 0, s->length);
#else
        memset(PHI_ROW_AT(rows), 0, (size_t)s->width * sizeof *rows);
        memcpy(PHI_ROW_AT(rows), PHI_VALUES_AT(values), (size_t)s->length * sizeof *rows);
#endif
    }
}

#if PHI_SEAMS
/* The kind of each site: its colour, and as many more for each seam that it is on. */
static void phi_put_kinds(const phi_solver *s)
{
    PHI_EACH_ROW {
        double *row = PHI_ROW_AT(s->kinds);
        ptrdiff_t place[PHI_AXES];
#if !PHI_ONE_ROW
        phi_place(s, r, place);
#endif
        for (ptrdiff_t i = 0; i < s->length; ++i) {
            int colour = 0, window = 0;
            place[PHI_LAST_AXIS] = i;
            for (int a = 0; a < PHI_AXES; ++a) {
                colour += (int)(place[a] % PHI_COLOUR_COUNT) * phi_colours[a];
                window |= (place[a] >= s->seams[a]) << a;
            }
            row[i] = (double)(window * PHI_COLOUR_COUNT + colour % PHI_COLOUR_COUNT);
        }
        PHI_COPY_ENDS(row, s->length, 0, s->length)
    }
}

#endif
#if PHI_SITE_PARAMETERS
/* The values of a parameter at sites, or one value for all. */
static void phi_put_parameter(const phi_solver *s, double *rows, const double *values, double value)
{
    for (ptrdiff_t i = PHI_LEAST; i < PHI_MEMORY_OF(PHI_BEYOND); ++i) rows[i] = value;
    if (values != NULL) phi_put(s, rows, values);
}

#endif

#include "parameters.h"
#if !PHI_ONE_ROW
/* Where a row is, and those beside it. */
static void phi_find_lines(const phi_solver *s, size_t index, ptrdiff_t at[PHI_LINES])
{
    ptrdiff_t place[PHI_AXES];
    phi_place(s, index, place);
    for (int k = 0; k < PHI_LINES; ++k) {
        ptrdiff_t line = 0;
        for (int a = 0; a < PHI_AXES - 1; ++a) {
            const ptrdiff_t size = (ptrdiff_t)s->sizes[a];
            ptrdiff_t p = place[a] + phi_lines[k][a];
            if (phi_open[a]) { /* mirrored, as in phi_ends */
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

#endif
/* ---- The solver ---- */
#if PHI_SERIES
/* Where y and what guesses need are, in blocks of memory. */
static void phi_place_middle(phi_solver *s, double *memory, size_t block)
{
    for (int k = 0; k < PHI_ARRAYS; ++k)
        for (int side = 0; side < PHI_SIDES; ++side)
            s->y[side][k] = k < PHI_DIM ? memory + (size_t)(PHI_SIDES * k + side) * block : s->x[k];
#if PHI_ADJOINT
    memcpy(s->y[2], s->x, sizeof s->x);
#endif
    memory += PHI_SIDES * PHI_DIM * block;
#if PHI_GUESSES
    PHI_EACH_STAGE
        for (int d = 0; d < PHI_DIFFERENCES; ++d)
            for (int k = 0; k < PHI_DIM; ++k, memory += block) PHI_OF(s->guess, stage).difference[d][k] = memory;
#endif
#if PHI_BANDED
    for (int k = 0; k < PHI_DIM; ++k, memory += block) s->v[k] = memory;
#endif
#if PHI_SITE_BLOCKS
    for (int k = 0; k < PHI_DIM * PHI_DIM; ++k, memory += block) s->block[k] = memory;
    for (int k = 0; k < PHI_DIM; ++k, memory += block) s->solved[k] = memory;
#endif
#if PHI_KRYLOV
    for (int d = 0; d <= PHI_DIRECTIONS; ++d)
        for (int k = 0; k < PHI_DIM; ++k, memory += block) s->space[d][k] = memory;
    s->sums = memory;
#endif
}

#endif
static void phi_prepare_step(const phi_params *params, double h, double *coef)
{
#if PHI_KICKS
    for (int k = 0; k < PHI_ROWS_OF_FLOWS; ++k) {
        const double kick[1] = { phi_multiples[k] * (h * h) };
        phi_prepare(params, phi_times[k] * h, kick, coef + k * PHI_ROW);
    }
#else
    for (int k = 0; k < PHI_ROWS_OF_FLOWS; ++k) phi_prepare(params, phi_times[k] * h, coef + k * PHI_ROW);
#endif
}

static int phi_finite(const double *values, size_t count)
{
    int finite = 1;
    for (size_t k = 0; k < count; ++k) finite &= isfinite(values[k]) != 0;
    return finite;
}

#if PHI_COMPENSATED
/* Go on as if rounding had left out nothing. */
static void phi_forget(phi_solver *s)
{
    for (size_t k = 0; k < PHI_DIM; ++k) memset(PHI_MEMORY_OF(s->carry[k]), 0, PHI_DOUBLES * sizeof *s->carry[k]);
    s->open = 0;
}

#endif
#if PHI_GRAPH
#if PHI_TIMED
phi_status phi_init(phi_solver *s, const phi_params *params, const size_t sizes[PHI_AXES], const phi_bonds *bonds,
    const double *x0, void *work)
{
    return phi_init_at(s, params, sizes, bonds, x0, 0.0, work);
}

phi_status phi_init_at(phi_solver *s, const phi_params *params, const size_t sizes[PHI_AXES], const phi_bonds *bonds,
    const double *x0, double t0, void *work)
#else
phi_status phi_init(phi_solver *s, const phi_params *params, const size_t sizes[PHI_AXES], const phi_bonds *bonds,
    const double *x0, void *work)
#endif
#else
#if PHI_TIMED
phi_status phi_init(phi_solver *s, const phi_params *params, const size_t sizes[PHI_AXES], const double *x0, void *work)
{
    return phi_init_at(s, params, sizes, x0, 0.0, work);
}

phi_status phi_init_at(
    phi_solver *s, const phi_params *params, const size_t sizes[PHI_AXES], const double *x0, double t0, void *work)
#else
phi_status phi_init(phi_solver *s, const phi_params *params, const size_t sizes[PHI_AXES], const double *x0, void *work)
#endif
#endif
{
    ptrdiff_t width;
    if (s == NULL || sizes == NULL || x0 == NULL || work == NULL) return PHI_BAD_ARGUMENT;
#if PHI_TIMED
    if (!isfinite(t0)) return PHI_BAD_ARGUMENT;
#endif
    const phi_params own = params != NULL ? *params : phi_default_params;
    const size_t rows = phi_shape(sizes, &width), length = sizes[PHI_LAST_AXIS], sites = rows * length;
#if PHI_GRAPH
    const size_t count = bonds != NULL ? bonds->count : 0;
    if (rows == 0 || !phi_few(sites, count) || !phi_connected(bonds, sites) || !phi_finite(x0, PHI_DIM * sites) ||
        !phi_allowed(&own, sites, count))
        return PHI_BAD_ARGUMENT;
#else
    if (rows == 0 || !phi_finite(x0, PHI_DIM * sites) || !phi_allowed(&own, sites)) return PHI_BAD_ARGUMENT;
#endif
#if PHI_RENEWED
    double coef[PHI_COEFFICIENTS] = { 0.0 };
#else
    double coef[PHI_COEFFICIENTS];
#endif
    phi_prepare_step(&own, PHI_PROBE_STEP, coef);
    if (!phi_finite(coef, PHI_COEFFICIENTS)) return PHI_BAD_ARGUMENT;
    memset(s, 0, sizeof *s);
    memcpy(s->sizes, sizes, sizeof s->sizes);
    s->sites = sites;
    s->rows = rows;
    s->length = (ptrdiff_t)length;
#if PHI_BY_HAND && PHI_ONE_ROW
    s->to = s->length;
#endif
    s->width = width;
#if PHI_SEAMS
    for (int a = 0; a < PHI_AXES; ++a) {
        const ptrdiff_t size = (ptrdiff_t)sizes[a], period = phi_seams[a][0], left = size % period;
        s->seams[a] = size - left;
        while (left > 0 && size - s->seams[a] < phi_seams[a][1]) s->seams[a] -= period;
        const ptrdiff_t near = left > 0 ? phi_seams[a][2] : 0;
        s->inside[0] = near;
        s->inside[1] = s->seams[a] - near;
    }
#endif
#if PHI_TIMED
    s->t = s->now = t0;
#endif
    s->params = own;
    double *memory = PHI_FIRST_SITE((double *)(void *)((char *)work + (64 - (uintptr_t)work % 64) % 64));
    const size_t block = phi_block(rows, width);
#if !PHI_ONE_ROW
    s->lines = (ptrdiff_t *)(void *)(PHI_MEMORY_OF(memory) + PHI_RESERVED * block);
    for (size_t r = 0; r < rows; ++r) phi_find_lines(s, r, s->lines + r * PHI_LINES);
#endif
#if PHI_BANDED
    s->matrix = PHI_MEMORY_OF(memory) + PHI_RESERVED * block;
#endif
#if PHI_GRAPH
    phi_connect(s, bonds, PHI_MEMORY_OF(memory) + PHI_RESERVED * block);
#endif
    for (size_t k = 0; k < PHI_ARRAYS; ++k, memory += block) s->x[k] = memory;
    for (size_t k = 0; k < PHI_DIM; ++k, memory += block) s->before[k] = memory;
#if PHI_GATHER
    for (size_t k = 0; k < PHI_GATHERED; ++k, memory += block) s->gathered[k] = memory;
#endif
#if PHI_SERIES
    phi_place_middle(s, memory, block);
#endif
    for (size_t k = 0; k < PHI_DIM; ++k) phi_put(s, s->x[k], x0 + k * sites);
#if PHI_COMPENSATED
    for (size_t k = 0; k < 2 * PHI_DIM; ++k, memory += block) s->carry[k] = memory;
    phi_forget(s);
#endif
#if PHI_SEAMS
    s->kinds = memory;
    phi_put_kinds(s);
#endif
#if PHI_SITE_PARAMETERS
    phi_put_parameters(s, &own);
#endif
#if PHI_GRAPH && PHI_BOND_PARAMETERS
    phi_put_at_bonds(s, &own);
#endif
    return PHI_OK;
}

/* What depends on the step size; nothing where that is as before. */
static phi_status phi_set_step(phi_solver *s, double h)
{
    if (s == NULL || !isfinite(h)) return PHI_BAD_ARGUMENT;
    if (s->prepared && memcmp(&h, &s->h, sizeof h) == 0) return PHI_OK;
#if !PHI_SERIES
    s->open = 0;
#endif
    phi_prepare_step(&s->params, h, s->coef);
    s->h = h;
    s->t_before_h = s->t;
    s->steps_before_h = s->steps;
    s->prepared = 1;
    return PHI_OK;
}
#if PHI_TIMED || PHI_NOISE

#if PHI_TIMED
/* The time after so many steps. */
static double phi_time_after(const phi_solver *s, size_t steps)
{
    return s->t_before_h + (double)(steps - s->steps_before_h) * s->h;
}

#endif
phi_status phi_passed(phi_solver *s, double h, size_t steps)
{
    const phi_status status = phi_set_step(s, h);
    if (status != PHI_OK || steps < s->steps_before_h) return PHI_BAD_ARGUMENT;
    s->steps = steps;
#if PHI_TIMED
    s->t = s->now = phi_time_after(s, steps);
#else
    s->t = s->t_before_h + (double)(steps - s->steps_before_h) * s->h;
#endif
    return PHI_OK;
}
#endif
#if PHI_RENEWED && !PHI_SERIES

/* A row of coefficients in the step after so many others. */
static void phi_renew(const phi_solver *s, int row, size_t steps, double coef[PHI_ROW])
{
    memcpy(coef, s->coef + row * PHI_ROW, PHI_PREPARED * sizeof *coef);
    phi_refresh(coef, phi_time_after(s, steps) + phi_moments[row] * s->h, coef + PHI_PREPARED);
}
#endif

/* Whether the fields are finite at all sites. */
static int phi_all_hold(const phi_solver *s, double *const *x)
{
    for (size_t k = 0; k < PHI_DIM; ++k)
        PHI_EACH_ROW
            if (!phi_finite(PHI_ROW_AT(x[k]), (size_t)s->length)) return 0;
    return 1;
}

/* Fields, with what is beside their rows. */
static void phi_copy(double *const *to, double *const *from, const phi_solver *s)
{
    const size_t block = PHI_DOUBLES * sizeof **from;
    for (size_t k = 0; k < PHI_DIM; ++k) memcpy(PHI_MEMORY_OF(to[k]), PHI_MEMORY_OF(from[k]), block);
#if PHI_COMPENSATED
    const size_t into = to == s->before ? PHI_DIM : 0; /* one of them is x, the other one before */
    for (size_t k = 0; k < PHI_DIM; ++k)
        memcpy(PHI_MEMORY_OF(s->carry[into + k]), PHI_MEMORY_OF(s->carry[PHI_DIM - into + k]), block);
#endif
}

#if PHI_TANGENT
/* The fields of a tangent vector. */
static void phi_vector(const phi_solver *s, size_t number, double *v[PHI_DIM])
{
    const size_t block = PHI_DOUBLES;
    for (size_t k = 0; k < PHI_DIM; ++k) v[k] = s->tangents + (number * PHI_DIM + k) * block;
}

#endif
#include "lattice_stages.c"
#include "lattice_flows.c"

phi_status phi_step(phi_solver *s, double h) { return phi_integrate(s, h, 1); }

#if PHI_TANGENT || PHI_ADJOINT || !PHI_SERIES && !PHI_NOISE
/* The sites of fields, without what is beside their rows. */
static void phi_take(const phi_solver *s, double *const *fields, double *x)
{
    for (size_t k = 0; k < PHI_DIM; ++k)
        PHI_EACH_ROW
            memcpy(PHI_VALUES_AT(x + k * s->sites), PHI_ROW_AT(fields[k]), (size_t)s->length * sizeof *x);
}

void phi_state(const phi_solver *s, double *x) { phi_take(s, s->x, x); }
#else
void phi_state(const phi_solver *s, double *x)
{
    for (size_t k = 0; k < PHI_DIM; ++k)
        PHI_EACH_ROW
            memcpy(PHI_VALUES_AT(x + k * s->sites), PHI_ROW_AT(s->x[k]), (size_t)s->length * sizeof *x);
}
#endif
#if PHI_KICKED

/* To x and so many times what is there. */
static phi_status phi_move(phi_solver *s, const double *x, double kept)
{
    if (s == NULL || x == NULL) return PHI_BAD_ARGUMENT;
    for (int moving = 0; moving < 2; ++moving) /* nothing, unless all of it can be */
        for (size_t r = 0; r < PHI_DIM * s->rows; ++r) {
            double *row = s->x[r / s->rows] + (ptrdiff_t)(r % s->rows) * s->width;
            for (ptrdiff_t i = 0; i < s->length; ++i) {
                const double moved = kept * row[i] + x[(ptrdiff_t)r * s->length + i];
                if (!isfinite(moved)) return PHI_BAD_ARGUMENT;
                row[i] = moving ? moved : row[i];
            }
            PHI_COPY_ENDS(row, s->length, 0, s->length)
        }
#if PHI_COMPENSATED
    phi_forget(s);
#elif !PHI_SERIES
    s->open = 0;
#endif
    return PHI_OK;
}

phi_status phi_set_state(phi_solver *s, const double *x) { return phi_move(s, x, 0.0); }

phi_status phi_kick(phi_solver *s, const double *change) { return phi_move(s, change, 1.0); }
#endif

#include "lattice_tangent.c"

#include "lattice_adjoint.c"

#if !PHI_SERIES && !PHI_NOISE || !PHI_SERIES && PHI_NEAR
int phi_saved(const phi_solver *s, double *x, size_t *far)
{
#if PHI_NOISE
    (void)x;
#else
    if (s->open) phi_take(s, s->before, x);
#if PHI_COMPENSATED
    if (s->open) phi_take(s, s->carry + PHI_DIM, x + PHI_DIM * s->sites);
#endif
#endif
    *far = s->far;
    return s->open;
}

phi_status phi_resume(phi_solver *s, double h, const double *x, size_t far)
{
#if PHI_NOISE
    if (x != NULL || phi_set_step(s, h) != PHI_OK) return PHI_BAD_ARGUMENT;
    s->far = far;
    return PHI_OK;
#else
#if PHI_COMPENSATED
    if (s == NULL || (x != NULL && !phi_finite(x, 2 * PHI_DIM * s->sites))) return PHI_BAD_ARGUMENT;
#else
    if (s == NULL || (x != NULL && !phi_finite(x, PHI_DIM * s->sites))) return PHI_BAD_ARGUMENT;
#endif
    if (phi_set_step(s, h) != PHI_OK) return PHI_BAD_ARGUMENT;
    s->far = far;
    if (x == NULL) return PHI_OK;
    for (size_t k = 0; k < PHI_DIM; ++k) phi_put(s, s->before[k], x + k * s->sites);
#if PHI_COMPENSATED
    for (size_t k = 0; k < PHI_DIM; ++k) phi_put(s, s->carry[PHI_DIM + k], x + (PHI_DIM + k) * s->sites);
#endif
    s->open = 1;
    return PHI_OK;
#endif
}

#endif
/* ---- What is seen at sites ---- */
double phi_hamiltonian(const phi_solver *s)
{
    double density[PHI_BUFFER], sum = 0.0, rest = 0.0;
    PHI_EACH_ROW {
        phi_row row = PHI_WHOLE_ROW;
        for (row.to = 0; row.to < s->length;) {
            row.from = row.to;
            row.to = s->length - row.from > PHI_BUFFER ? row.from + PHI_BUFFER : s->length;
            phi_energy_row(&row, density);
            for (ptrdiff_t i = 0; i < row.to - row.from; ++i) { /* compensated, after A. Neumaier */
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
#if PHI_OBSERVED

/* Adds densities of one observable to their sum, compensated after A. Neumaier, or takes the largest or least of them. */
static void phi_reduce(int kind, size_t count, const double *density, double *sum, double *rest)
{
    for (size_t i = 0; i < count; ++i) {
        const double next = density[i], total = *sum + next;
        if (kind < 2) {
            *rest += fabs(*sum) >= fabs(next) ? (*sum - total) + next : (next - total) + *sum;
            *sum = total;
        } else if (next != next || (kind == 2 ? next > *sum : next < *sum)) {
            *sum = next; /* one that is not a number stays, as no other is larger or less */
        }
    }
}

void phi_observables(const phi_solver *s, double *out)
{
    double density[PHI_OBSERVABLES * PHI_SHARE], rest[PHI_OBSERVABLES] = { 0.0 };
    for (int k = 0; k < PHI_OBSERVABLES; ++k) {
        const int kind = phi_reductions[k][0];
        out[k] = kind < 2 ? 0.0 : kind == 2 ? -HUGE_VAL : HUGE_VAL;
    }
    PHI_EACH_ROW {
        phi_row row = PHI_WHOLE_ROW;
        for (row.to = 0; row.to < s->length;) {
            row.from = row.to;
            row.to = s->length - row.from > PHI_SHARE ? row.from + PHI_SHARE : s->length;
            phi_observables_row(&row, density);
            for (int k = 0; k < PHI_OBSERVABLES; ++k)
                phi_reduce(phi_reductions[k][0], (size_t)(row.to - row.from), density + k * PHI_SHARE, out + k, rest + k);
        }
    }
    const double sites = (double)s->sites;
#if PHI_GRAPH
    const double counts[3] = { sites, (double)s->bonds[s->sites] / 2.0, 0.0 };
#else
    const double counts[3] = { sites, 0.0, sites * (sites - 1.0) / 2.0 };
#endif
    for (int k = 0; k < PHI_OBSERVABLES; ++k) {
        out[k] += rest[k];
        if (phi_reductions[k][0] == 0) out[k] /= counts[phi_reductions[k][1]];
    }
}
#endif
#if PHI_OBSERVED_FIELDS

void phi_observed_fields(const phi_solver *s, double *out)
{
    PHI_EACH_ROW {
        const phi_row row = PHI_WHOLE_ROW;
        phi_observed_fields_row(&row, PHI_VALUES_AT(out));
    }
}
#endif

#include "lattice_by_hand.c"
#include "status.c"

size_t phi_solver_size(void) { return sizeof(phi_solver); }

size_t phi_solver_steps_done(const phi_solver *s) { return s->steps; }

#endif
