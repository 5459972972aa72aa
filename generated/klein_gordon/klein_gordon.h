/*
 * The declarations of klein_gordon.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 975c1405e9687a716ddf54367628dfadc5098578e149e4426cd0a93c037875a1
 */
#ifndef KLEIN_GORDON_H
#define KLEIN_GORDON_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define klein_gordon_AXES 1 /* i */
#define klein_gordon_DIM 2  /* fields of a site: q, p */
#define klein_gordon_ORDER 4
#define klein_gordon_CASIMIRS 0
#define klein_gordon_PHIGEN_VERSION "0.1.0"
#define klein_gordon_SPEC_SHA256 "7112ca265099ca014624ad4b2296070ddc860c26540d0b80acc378e27176e991"

typedef struct {
    double d; /* spacing */
} klein_gordon_params;

extern const klein_gordon_params klein_gordon_default_params;

enum { klein_gordon_ARRAYS = 2 };        /* arrays over the sites: fields, then parameters */
enum { klein_gordon_COEFFICIENTS = 28 }; /* numbers that depend on params and h only */

typedef enum { klein_gordon_OK = 0, klein_gordon_NO_CONVERGENCE, klein_gordon_SINGULAR,
    klein_gordon_NOT_FINITE, klein_gordon_BAD_ARGUMENT } klein_gordon_status;

/* The state is kept in memory of the caller.
   A field is a row: all its sites, with copies of the other end beside them.
   Set it up with klein_gordon_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[klein_gordon_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[klein_gordon_ARRAYS];
    double *before[klein_gordon_DIM]; /* the fields before the steps that are being made */
    int open; /* whether these lack the last flow of a step, which between calls x has made */
    size_t far; /* steps to be made by functions for large arguments, where there are others */
    size_t steps; /* good steps since klein_gordon_init */
    double t; /* time since klein_gordon_init */
    double h; /* the last step size */
    klein_gordon_params params;
    double coef[klein_gordon_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared; /* whether coef has been computed */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} klein_gordon_solver;

/* The bytes that the solver of a lattice needs as its memory; 0 for sizes that are not allowed. */
size_t klein_gordon_work_size(const size_t sizes[klein_gordon_AXES]);

/* Start at x0[field][site], the last axis fastest, with klein_gordon_work_size(sizes) bytes of memory, as
   from malloc, which must stay. params may be NULL for the defaults; its arrays are copied.
   klein_gordon_BAD_ARGUMENT if sizes are not allowed, x0 or a parameter is not finite, or one that has to be
   positive is not. */
klein_gordon_status klein_gordon_init(klein_gordon_solver *s, const klein_gordon_params *params,
    const size_t sizes[klein_gordon_AXES], const double *x0, void *work);

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good
   ones. Steps are joined, also those of several calls: where one ends as the next begins, both are one flow.
   With OpenMP rows are worked at in parallel, with the same bits for any number of threads. */
klein_gordon_status klein_gordon_step(klein_gordon_solver *s, double h);
klein_gordon_status klein_gordon_integrate(klein_gordon_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void klein_gordon_state(const klein_gordon_solver *s, double *x);

/* To go on elsewhere with the same bits: if klein_gordon_saved is 1, x is what the next step begins with, for
   klein_gordon_resume after klein_gordon_init at the state. If it is 0, klein_gordon_resume has NULL for
   x. */
int klein_gordon_saved(const klein_gordon_solver *s, double *x, size_t *far);
klein_gordon_status klein_gordon_resume(klein_gordon_solver *s, double h, const double *x, size_t far);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double klein_gordon_hamiltonian(const klein_gordon_solver *s);
void klein_gordon_density(const klein_gordon_solver *s, double *out);
void klein_gordon_casimirs(const klein_gordon_solver *s, double *out);
void klein_gordon_vector_field(const klein_gordon_solver *s, double *out);

const char *klein_gordon_status_string(klein_gordon_status status);

/* For bindings: the size of klein_gordon_solver, and its count of good steps. */
size_t klein_gordon_solver_size(void);
size_t klein_gordon_solver_steps_done(const klein_gordon_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* KLEIN_GORDON_H */
