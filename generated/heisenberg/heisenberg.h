/*
 * The declarations of heisenberg.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 21b99811df45cccf9ff35382c7df283131ec74c865a886c496e18dc246c20a11
 */
#ifndef HEISENBERG_H
#define HEISENBERG_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define heisenberg_AXES 3 /* the slowest first: i, j, k */
#define heisenberg_DIM 3  /* fields of a site: x, y, z */
#define heisenberg_ORDER 2
#define heisenberg_CASIMIRS 1 /* C */
#define heisenberg_PHIGEN_VERSION "0.1.0"
#define heisenberg_SPEC_SHA256 "db9e76c21c97df18ba40343805d35a8a7c249010c0d791ca8dab69a55383c332"

typedef struct {
    double J;        /* default 1.0 */
    const double *B; /* at sites: field along z; NULL for the default at all of them */
} heisenberg_params;

extern const heisenberg_params heisenberg_default_params;

enum { heisenberg_ARRAYS = 4 };        /* arrays over the sites: fields, then parameters */
enum { heisenberg_COEFFICIENTS = 18 }; /* numbers that depend on params and h only */

typedef enum { heisenberg_OK = 0, heisenberg_NO_CONVERGENCE, heisenberg_SINGULAR, heisenberg_NOT_FINITE,
    heisenberg_BAD_ARGUMENT } heisenberg_status;

/* The state is kept in memory of the caller.
   A field is many rows: a row is all sites along the last axis, with copies of the other end beside them.
   Set it up with heisenberg_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[heisenberg_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[heisenberg_ARRAYS];
    ptrdiff_t *lines; /* of each row, where it is and where those beside it are */
    double *before[heisenberg_DIM]; /* the fields before the steps that are being made */
    int open; /* whether these lack the last flow of a step, which between calls x has made */
    size_t far; /* steps to be made by functions for large arguments, where there are others */
    size_t steps; /* good steps since heisenberg_init */
    double t; /* time since heisenberg_init */
    double h; /* the last step size */
    heisenberg_params params;
    double coef[heisenberg_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared; /* whether coef has been computed */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} heisenberg_solver;

/* The bytes that the solver of a lattice needs as its memory; 0 for sizes that are not allowed. */
size_t heisenberg_work_size(const size_t sizes[heisenberg_AXES]);

/* Start at x0[field][site], the last axis fastest, with heisenberg_work_size(sizes) bytes of memory, as from
   malloc, which must stay. params may be NULL for the defaults; its arrays are copied.
   heisenberg_BAD_ARGUMENT if sizes are not allowed, x0 or a parameter is not finite, or one that has to be
   positive is not. */
heisenberg_status heisenberg_init(heisenberg_solver *s, const heisenberg_params *params,
    const size_t sizes[heisenberg_AXES], const double *x0, void *work);

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good
   ones. Steps are joined, also those of several calls: where one ends as the next begins, both are one flow.
   With OpenMP rows are worked at in parallel, with the same bits for any number of threads. */
heisenberg_status heisenberg_step(heisenberg_solver *s, double h);
heisenberg_status heisenberg_integrate(heisenberg_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void heisenberg_state(const heisenberg_solver *s, double *x);

/* Between steps: stand at x, or move by change, both [field][site], all else being as it was, also on
   heisenberg_BAD_ARGUMENT. */
heisenberg_status heisenberg_set_state(heisenberg_solver *s, const double *x);
heisenberg_status heisenberg_kick(heisenberg_solver *s, const double *change);

/* To go on elsewhere with the same bits: if heisenberg_saved is 1, x is what the next step begins with, for
   heisenberg_resume after heisenberg_init at the state. If it is 0, heisenberg_resume has NULL for x. */
int heisenberg_saved(const heisenberg_solver *s, double *x, size_t *far);
heisenberg_status heisenberg_resume(heisenberg_solver *s, double h, const double *x, size_t far);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double heisenberg_hamiltonian(const heisenberg_solver *s);
void heisenberg_density(const heisenberg_solver *s, double *out);
void heisenberg_casimirs(const heisenberg_solver *s, double *out);
void heisenberg_vector_field(const heisenberg_solver *s, double *out);

/* Steps by hand, for lattices that are distributed over several memories. A step is the stages 0, 1, ...
   before heisenberg_stages(), each a sweep over all planes: the sites of one place along the first axis.
   Number heisenberg_stages(), which with noise there is not, is the last stage of a step and the first of the
   next together, as heisenberg_integrate does them. A stage may be made in any number of pieces, in any
   order, with the bits of heisenberg_step; before that, the planes beside a piece that it reads must have
   made the stages before. */
typedef struct {
    /* planes before the first one swept, and after the last one, that are read */
    size_t behind, ahead;
    /* fields that are read there, and those that are changed; bit k is field k */
    unsigned long read, changed;
} heisenberg_stage;

size_t heisenberg_stages(void);
heisenberg_status heisenberg_describe(size_t number, heisenberg_stage *about);

/* What depends on the step size, before the first stage; and a stage for the planes from..to, to not among
   them. far: whether by functions for arguments of any size; without it, values that are not finite say that
   these were needed. */
heisenberg_status heisenberg_begin(heisenberg_solver *s, double h);
heisenberg_status heisenberg_sweep(heisenberg_solver *s, size_t number, int far, size_t from, size_t to);

/* Values x[plane of those from..to][sites of it] of a field, which is 0 for the first; putting them takes the
   place of what was there. heisenberg_holds tells whether those of all fields there are finite. */
heisenberg_status heisenberg_planes(const heisenberg_solver *s, size_t field, size_t from, size_t to,
    double *x);
heisenberg_status heisenberg_put_planes(heisenberg_solver *s, size_t field, size_t from, size_t to,
    const double *x);
int heisenberg_holds(const heisenberg_solver *s, size_t from, size_t to);

const char *heisenberg_status_string(heisenberg_status status);

/* For bindings: the size of heisenberg_solver, and its count of good steps. */
size_t heisenberg_solver_size(void);
size_t heisenberg_solver_steps_done(const heisenberg_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* HEISENBERG_H */
