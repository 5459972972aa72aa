/*
 * The declarations of fput.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: a81498a141b23801a2d6962a76f86768e4a1d9c068d2b8c794d70d2bdb9cab6f
 */
#ifndef FPUT_H
#define FPUT_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define fput_AXES 1 /* i */
#define fput_DIM 2  /* fields of a site: q, p */
#define fput_ORDER 4
#define fput_CASIMIRS 0
#define fput_PHIGEN_VERSION "0.1.0"
#define fput_SPEC_SHA256 "920c8e7d73465dacb3469db42d998ea7ea21c0581ec9a57019e9692074a2c0da"

typedef struct {
    double alpha; /* default 0.25 */
    double beta;  /* default 0.1 */
} fput_params;

extern const fput_params fput_default_params;

enum { fput_ARRAYS = 2 };        /* arrays over the sites: fields, then parameters */
enum { fput_COEFFICIENTS = 56 }; /* numbers that depend on params and h only */

typedef enum { fput_OK = 0, fput_NO_CONVERGENCE, fput_SINGULAR, fput_NOT_FINITE,
    fput_BAD_ARGUMENT } fput_status;

/* The state is kept in memory of the caller.
   A field is a row: all its sites, with copies of the other end beside them.
   Set it up with fput_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[fput_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[fput_ARRAYS];
    double *before[fput_DIM]; /* the fields before the steps that are being made */
    int open;                 /* whether these lack the last flow of a step, which between calls x has made */
    size_t far;               /* steps to be made by functions for large arguments, where there are others */
    ptrdiff_t from, to;       /* the sites that are swept */
    size_t steps;             /* good steps since fput_init */
    double t;                 /* time since fput_init */
    double h;                 /* the last step size */
    fput_params params;
    double coef[fput_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared; /* whether coef has been computed */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} fput_solver;

/* The bytes that the solver of a lattice needs as its memory; 0 for sizes that are not allowed. */
size_t fput_work_size(const size_t sizes[fput_AXES]);

/* Start at x0[field][site], the last axis fastest, with fput_work_size(sizes) bytes of memory, as from
   malloc, which must stay. params may be NULL for the defaults; its arrays are copied. fput_BAD_ARGUMENT if
   sizes are not allowed, x0 or a parameter is not finite, or one that has to be positive is not. */
fput_status fput_init(fput_solver *s, const fput_params *params, const size_t sizes[fput_AXES],
    const double *x0, void *work);

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good
   ones. Steps are joined, also those of several calls: where one ends as the next begins, both are one flow.
   With OpenMP rows are worked at in parallel, with the same bits for any number of threads. */
fput_status fput_step(fput_solver *s, double h);
fput_status fput_integrate(fput_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void fput_state(const fput_solver *s, double *x);

/* Between steps: stand at x, or move by change, both [field][site], all else being as it was, also on
   fput_BAD_ARGUMENT. */
fput_status fput_set_state(fput_solver *s, const double *x);
fput_status fput_kick(fput_solver *s, const double *change);

/* To go on elsewhere with the same bits: if fput_saved is 1, x is what the next step begins with, for
   fput_resume after fput_init at the state. If it is 0, fput_resume has NULL for x. */
int fput_saved(const fput_solver *s, double *x, size_t *far);
fput_status fput_resume(fput_solver *s, double h, const double *x, size_t far);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double fput_hamiltonian(const fput_solver *s);
void fput_density(const fput_solver *s, double *out);
void fput_casimirs(const fput_solver *s, double *out);
void fput_vector_field(const fput_solver *s, double *out);

/* Steps by hand, for lattices that are distributed over several memories. A step is the stages 0, 1, ...
   before fput_stages(), each a sweep over all planes: the sites of one place along the first axis. Number
   fput_stages(), which with noise there is not, is the last stage of a step and the first of the next
   together, as fput_integrate does them. A stage may be made in any number of pieces, in any order, with the
   bits of fput_step; before that, the planes beside a piece that it reads must have made the stages
   before. */
typedef struct {
    /* planes before the first one swept, and after the last one, that are read */
    size_t behind, ahead;
    /* fields that are read there, and those that are changed; bit k is field k */
    unsigned long read, changed;
} fput_stage;

size_t fput_stages(void);
fput_status fput_describe(size_t number, fput_stage *about);

/* What depends on the step size, before the first stage; and a stage for the planes from..to, to not among
   them. far: whether by functions for arguments of any size; without it, values that are not finite say that
   these were needed. */
fput_status fput_begin(fput_solver *s, double h);
fput_status fput_sweep(fput_solver *s, size_t number, int far, size_t from, size_t to);

/* Values x[plane of those from..to][sites of it] of a field, which is 0 for the first; putting them takes the
   place of what was there. fput_holds tells whether those of all fields there are finite. */
fput_status fput_planes(const fput_solver *s, size_t field, size_t from, size_t to, double *x);
fput_status fput_put_planes(fput_solver *s, size_t field, size_t from, size_t to, const double *x);
int fput_holds(const fput_solver *s, size_t from, size_t to);

const char *fput_status_string(fput_status status);

/* For bindings: the size of fput_solver, and its count of good steps. */
size_t fput_solver_size(void);
size_t fput_solver_steps_done(const fput_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* FPUT_H */
