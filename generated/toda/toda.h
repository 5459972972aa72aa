/*
 * The declarations of toda.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 6c68c9a9a9647c9abd3c476e0bca627b35e20cee9c2c8f9f0ec2034ca127f4e5
 */
#ifndef TODA_H
#define TODA_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define toda_AXES 1 /* i */
#define toda_DIM 2  /* fields of a site: a, b */
#define toda_ORDER 4
#define toda_CASIMIRS 2 /* momentum, length */
#define toda_PHIGEN_VERSION "0.1.0"
#define toda_SPEC_SHA256 "f26949756f578199f03099c1eb735187896f28e684aa7a5623cea3cfe88fe402"

typedef struct {
    char unused; /* this system has no parameters */
} toda_params;

extern const toda_params toda_default_params;

enum { toda_ARRAYS = 2 };        /* arrays over the sites: fields, then parameters */
enum { toda_COEFFICIENTS = 28 }; /* numbers that depend on params and h only */

typedef enum { toda_OK = 0, toda_NO_CONVERGENCE, toda_SINGULAR, toda_NOT_FINITE,
    toda_BAD_ARGUMENT } toda_status;

/* The state is kept in memory of the caller.
   A field is a row: all its sites, with copies of the other end beside them.
   Set it up with toda_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[toda_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[toda_ARRAYS];
    double *before[toda_DIM]; /* the fields before the steps that are being made */
    int open;                 /* whether these lack the last flow of a step, which between calls x has made */
    size_t far;               /* steps to be made by functions for large arguments, where there are others */
    size_t steps;             /* good steps since toda_init */
    double t;                 /* time since toda_init */
    double h;                 /* the last step size */
    toda_params params;
    double coef[toda_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared; /* whether coef has been computed */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} toda_solver;

/* The bytes that the solver of a lattice needs as its memory; 0 for sizes that are not allowed. */
size_t toda_work_size(const size_t sizes[toda_AXES]);

/* Start at x0[field][site], the last axis fastest, with toda_work_size(sizes) bytes of memory, as from
   malloc, which must stay. params may be NULL for the defaults; its arrays are copied. toda_BAD_ARGUMENT if
   sizes are not allowed, x0 or a parameter is not finite, or one that has to be positive is not. */
toda_status toda_init(toda_solver *s, const toda_params *params, const size_t sizes[toda_AXES],
    const double *x0, void *work);

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good
   ones. Steps are joined, also those of several calls: where one ends as the next begins, both are one flow.
   With OpenMP rows are worked at in parallel, with the same bits for any number of threads. */
toda_status toda_step(toda_solver *s, double h);
toda_status toda_integrate(toda_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void toda_state(const toda_solver *s, double *x);

/* To go on elsewhere with the same bits: if toda_saved is 1, x is what the next step begins with, for
   toda_resume after toda_init at the state. If it is 0, toda_resume has NULL for x. */
int toda_saved(const toda_solver *s, double *x, size_t *far);
toda_status toda_resume(toda_solver *s, double h, const double *x, size_t far);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double toda_hamiltonian(const toda_solver *s);
void toda_density(const toda_solver *s, double *out);
void toda_casimirs(const toda_solver *s, double *out);
void toda_vector_field(const toda_solver *s, double *out);

const char *toda_status_string(toda_status status);

/* For bindings: the size of toda_solver, and its count of good steps. */
size_t toda_solver_size(void);
size_t toda_solver_steps_done(const toda_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* TODA_H */
