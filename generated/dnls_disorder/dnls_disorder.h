/*
 * The declarations of dnls_disorder.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 0e062797848dfe722f25f73c48efeae24828d99f860eb927203c7dacc7992a78
 */
#ifndef DNLS_DISORDER_H
#define DNLS_DISORDER_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define dnls_disorder_AXES 1 /* i */
#define dnls_disorder_DIM 2  /* fields of a site: q, p */
#define dnls_disorder_ORDER 4
#define dnls_disorder_CASIMIRS 0
#define dnls_disorder_PHIGEN_VERSION "0.1.0"
#define dnls_disorder_SPEC_SHA256 "42d91db27e3f486cfdaf2925c387320de242ded35973e01dfa602c1731ae5ee2"

typedef struct {
    double beta;     /* default 0.72 */
    const double *e; /* at sites: energies of the sites */
} dnls_disorder_params;

extern const dnls_disorder_params dnls_disorder_default_params;

enum { dnls_disorder_ARRAYS = 3 };        /* arrays over the sites: fields, then parameters */
enum { dnls_disorder_COEFFICIENTS = 52 }; /* numbers that depend on params and h only */

typedef enum { dnls_disorder_OK = 0, dnls_disorder_NO_CONVERGENCE, dnls_disorder_SINGULAR,
    dnls_disorder_NOT_FINITE, dnls_disorder_BAD_ARGUMENT } dnls_disorder_status;

/* The state is kept in memory of the caller.
   A field is a row: all its sites, with copies of the other end beside them.
   Set it up with dnls_disorder_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[dnls_disorder_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[dnls_disorder_ARRAYS];
    double *before[dnls_disorder_DIM]; /* the fields before the steps that are being made */
    int open; /* whether these lack the last flow of a step, which between calls x has made */
    size_t far; /* steps to be made by functions for large arguments, where there are others */
    size_t steps; /* good steps since dnls_disorder_init */
    double t; /* time since dnls_disorder_init */
    double h; /* the last step size */
    dnls_disorder_params params;
    double coef[dnls_disorder_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared; /* whether coef has been computed */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} dnls_disorder_solver;

/* The bytes that the solver of a lattice needs as its memory; 0 for sizes that are not allowed. */
size_t dnls_disorder_work_size(const size_t sizes[dnls_disorder_AXES]);

/* Start at x0[field][site], the last axis fastest, with dnls_disorder_work_size(sizes) bytes of memory, as
   from malloc, which must stay. params may be NULL for the defaults; its arrays are copied.
   dnls_disorder_BAD_ARGUMENT if sizes are not allowed, x0 or a parameter is not finite, or one that has to be
   positive is not. */
dnls_disorder_status dnls_disorder_init(dnls_disorder_solver *s, const dnls_disorder_params *params,
    const size_t sizes[dnls_disorder_AXES], const double *x0, void *work);

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good
   ones. Steps are joined, also those of several calls: where one ends as the next begins, both are one flow.
   With OpenMP rows are worked at in parallel, with the same bits for any number of threads. */
dnls_disorder_status dnls_disorder_step(dnls_disorder_solver *s, double h);
dnls_disorder_status dnls_disorder_integrate(dnls_disorder_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void dnls_disorder_state(const dnls_disorder_solver *s, double *x);

/* To go on elsewhere with the same bits: if dnls_disorder_saved is 1, x is what the next step begins with,
   for dnls_disorder_resume after dnls_disorder_init at the state. If it is 0, dnls_disorder_resume has NULL
   for x. */
int dnls_disorder_saved(const dnls_disorder_solver *s, double *x, size_t *far);
dnls_disorder_status dnls_disorder_resume(dnls_disorder_solver *s, double h, const double *x, size_t far);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double dnls_disorder_hamiltonian(const dnls_disorder_solver *s);
void dnls_disorder_density(const dnls_disorder_solver *s, double *out);
void dnls_disorder_casimirs(const dnls_disorder_solver *s, double *out);
void dnls_disorder_vector_field(const dnls_disorder_solver *s, double *out);

const char *dnls_disorder_status_string(dnls_disorder_status status);

/* For bindings: the size of dnls_disorder_solver, and its count of good steps. */
size_t dnls_disorder_solver_size(void);
size_t dnls_disorder_solver_steps_done(const dnls_disorder_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* DNLS_DISORDER_H */
