/*
 * The declarations of volterra.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 18f0480474b291acd497aa37aaf8a6e064d49ce9461486d0e65a3993d7aad92e
 */
#ifndef VOLTERRA_H
#define VOLTERRA_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define volterra_AXES 1 /* i */
#define volterra_DIM 1  /* fields of a site: a */
#define volterra_ORDER 4
#define volterra_CASIMIRS 1 /* product */
#define volterra_PHIGEN_VERSION "0.1.0"
#define volterra_SPEC_SHA256 "c5b173d647010b0d2f2acd87d0dc22593f2b1c1fbce2fb51bb44ed0467462b1a"

typedef struct {
    char unused; /* this system has no parameters */
} volterra_params;

extern const volterra_params volterra_default_params;

enum { volterra_ARRAYS = 1 };        /* arrays over the sites: fields, then parameters */
enum { volterra_COEFFICIENTS = 14 }; /* numbers that depend on params and h only */

typedef enum { volterra_OK = 0, volterra_NO_CONVERGENCE, volterra_SINGULAR, volterra_NOT_FINITE,
    volterra_BAD_ARGUMENT } volterra_status;

/* The state is kept in memory of the caller.
   A field is a row: all its sites, with copies of the other end beside them.
   Set it up with volterra_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[volterra_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[volterra_ARRAYS];
    double *before[volterra_DIM]; /* the fields before the steps that are being made */
    int open; /* whether these lack the last flow of a step, which between calls x has made */
    size_t far; /* steps to be made by functions for large arguments, where there are others */
    size_t steps; /* good steps since volterra_init */
    double t; /* time since volterra_init */
    double h; /* the last step size */
    volterra_params params;
    double coef[volterra_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared; /* whether coef has been computed */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} volterra_solver;

/* The bytes that the solver of a lattice needs as its memory; 0 for sizes that are not allowed. */
size_t volterra_work_size(const size_t sizes[volterra_AXES]);

/* Start at x0[field][site], the last axis fastest, with volterra_work_size(sizes) bytes of memory, as from
   malloc, which must stay. params may be NULL for the defaults; its arrays are copied. volterra_BAD_ARGUMENT
   if sizes are not allowed, x0 or a parameter is not finite, or one that has to be positive is not. */
volterra_status volterra_init(volterra_solver *s, const volterra_params *params,
    const size_t sizes[volterra_AXES], const double *x0, void *work);

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good
   ones. Steps are joined, also those of several calls: where one ends as the next begins, both are one flow.
   With OpenMP rows are worked at in parallel, with the same bits for any number of threads. */
volterra_status volterra_step(volterra_solver *s, double h);
volterra_status volterra_integrate(volterra_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void volterra_state(const volterra_solver *s, double *x);

/* To go on elsewhere with the same bits: if volterra_saved is 1, x is what the next step begins with, for
   volterra_resume after volterra_init at the state. If it is 0, volterra_resume has NULL for x. */
int volterra_saved(const volterra_solver *s, double *x, size_t *far);
volterra_status volterra_resume(volterra_solver *s, double h, const double *x, size_t far);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double volterra_hamiltonian(const volterra_solver *s);
void volterra_density(const volterra_solver *s, double *out);
void volterra_casimirs(const volterra_solver *s, double *out);
void volterra_vector_field(const volterra_solver *s, double *out);

const char *volterra_status_string(volterra_status status);

/* For bindings: the size of volterra_solver, and its count of good steps. */
size_t volterra_solver_size(void);
size_t volterra_solver_steps_done(const volterra_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* VOLTERRA_H */
