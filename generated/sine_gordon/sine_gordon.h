/*
 * The declarations of sine_gordon.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 97e0f89e773da3ad111e9e931cd76bb87bdddc4f3fd07b1a13a5fb85cb37e6eb
 */
#ifndef SINE_GORDON_H
#define SINE_GORDON_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define sine_gordon_AXES 1 /* i */
#define sine_gordon_DIM 2  /* fields of a site: q, p */
#define sine_gordon_ORDER 4
#define sine_gordon_CASIMIRS 0
#define sine_gordon_PHIGEN_VERSION "0.1.0"
#define sine_gordon_SPEC_SHA256 "bbdf381e8130e0006aabbc4d0520ecb9190dd9410337e3a09499570017526a61"

typedef struct {
    double d; /* spacing */
} sine_gordon_params;

extern const sine_gordon_params sine_gordon_default_params;

enum { sine_gordon_ARRAYS = 2 };        /* arrays over the sites: fields, then parameters */
enum { sine_gordon_COEFFICIENTS = 42 }; /* numbers that depend on params and h only */

typedef enum { sine_gordon_OK = 0, sine_gordon_NO_CONVERGENCE, sine_gordon_SINGULAR, sine_gordon_NOT_FINITE,
    sine_gordon_BAD_ARGUMENT } sine_gordon_status;

/* The state is kept in memory of the caller.
   A field is a row: all its sites, with copies of the other end beside them.
   Set it up with sine_gordon_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[sine_gordon_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[sine_gordon_ARRAYS];
    double *before[sine_gordon_DIM]; /* the fields before the steps that are being made */
    int open; /* whether these lack the last flow of a step, which between calls x has made */
    size_t far; /* steps to be made by functions for large arguments, where there are others */
    size_t steps; /* good steps since sine_gordon_init */
    double t; /* time since sine_gordon_init */
    double h; /* the last step size */
    sine_gordon_params params;
    double coef[sine_gordon_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared; /* whether coef has been computed */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} sine_gordon_solver;

/* The bytes that the solver of a lattice needs as its memory; 0 for sizes that are not allowed. */
size_t sine_gordon_work_size(const size_t sizes[sine_gordon_AXES]);

/* Start at x0[field][site], the last axis fastest, with sine_gordon_work_size(sizes) bytes of memory, as from
   malloc, which must stay. params may be NULL for the defaults; its arrays are copied.
   sine_gordon_BAD_ARGUMENT if sizes are not allowed, x0 or a parameter is not finite, or one that has to be
   positive is not. */
sine_gordon_status sine_gordon_init(sine_gordon_solver *s, const sine_gordon_params *params,
    const size_t sizes[sine_gordon_AXES], const double *x0, void *work);

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good
   ones. Steps are joined, also those of several calls: where one ends as the next begins, both are one flow.
   With OpenMP rows are worked at in parallel, with the same bits for any number of threads. */
sine_gordon_status sine_gordon_step(sine_gordon_solver *s, double h);
sine_gordon_status sine_gordon_integrate(sine_gordon_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void sine_gordon_state(const sine_gordon_solver *s, double *x);

/* To go on elsewhere with the same bits: if sine_gordon_saved is 1, x is what the next step begins with, for
   sine_gordon_resume after sine_gordon_init at the state. If it is 0, sine_gordon_resume has NULL for x. */
int sine_gordon_saved(const sine_gordon_solver *s, double *x, size_t *far);
sine_gordon_status sine_gordon_resume(sine_gordon_solver *s, double h, const double *x, size_t far);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double sine_gordon_hamiltonian(const sine_gordon_solver *s);
void sine_gordon_density(const sine_gordon_solver *s, double *out);
void sine_gordon_casimirs(const sine_gordon_solver *s, double *out);
void sine_gordon_vector_field(const sine_gordon_solver *s, double *out);

const char *sine_gordon_status_string(sine_gordon_status status);

/* For bindings: the size of sine_gordon_solver, and its count of good steps. */
size_t sine_gordon_solver_size(void);
size_t sine_gordon_solver_steps_done(const sine_gordon_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* SINE_GORDON_H */
