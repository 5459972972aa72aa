/*
 * fput.h: the declarations; fput.c says how they were made.
 * DO NOT EDIT: edits are noticed by the checksum below.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 32c0ad799a2b385fc60c377e42be4951543fcd1938744b36cb4d8a159aafc043
 */
#ifndef FPUT_H
#define FPUT_H

#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif

#define fput_AXES 1
#define fput_DIM 2
#define fput_ORDER 4
#define fput_CASIMIRS 0
#define fput_PHIGEN_VERSION "0.1.0"
#define fput_SPEC_SHA256 "920c8e7d73465dacb3469db42d998ea7ea21c0581ec9a57019e9692074a2c0da"

/* Axes, the slowest first: i. Fields of a site: q, p. Casimirs: none. */
typedef struct {
    double alpha; /* default 0.25 */
    double beta;  /* default 0.1 */
} fput_params;

extern const fput_params fput_default_params;

enum { fput_ARRAYS = 2 };        /* arrays over the sites: fields, then parameters */
enum { fput_COEFFICIENTS = 56 }; /* numbers that depend on params and h only */

/* How a step ends; fput_status_string says it in words. */
typedef enum {
    fput_OK = 0, fput_NO_CONVERGENCE, fput_SINGULAR, fput_NOT_FINITE, fput_BAD_ARGUMENT
} fput_status;

/* The solver keeps the state in memory of the caller, row by row: a row is all sites along the last axis,
   with copies of the other end beside it. Set it up with fput_init; a copy of the struct is the same solver,
   not another one. */
typedef struct {
    size_t sizes[fput_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[fput_ARRAYS];
    ptrdiff_t *lines;         /* of each row, where it is and where those beside it are */
    double *before[fput_DIM]; /* the fields before the steps that are being made */
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
   ones. Steps of one call are joined: where a step ends as the next begins, both are one flow. With OpenMP
   rows are worked at in parallel, with the same bits for any number of threads. */
fput_status fput_step(fput_solver *s, double h);
fput_status fput_integrate(fput_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void fput_state(const fput_solver *s, double *x);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double fput_hamiltonian(const fput_solver *s);
void fput_density(const fput_solver *s, double *out);
void fput_casimirs(const fput_solver *s, double *out);
void fput_vector_field(const fput_solver *s, double *out);

const char *fput_status_string(fput_status status);

/* For bindings: the size of fput_solver, and its count of good steps. */
size_t fput_solver_size(void);
size_t fput_solver_steps_done(const fput_solver *s);

#ifdef __cplusplus
}
#endif

#endif /* FPUT_H */
