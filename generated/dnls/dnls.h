/*
 * The declarations of dnls.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 67f2277fafda38063237c6430c08891e2af3ecef9d238a7fbde59dc4b49c16ed
 */
#ifndef DNLS_H
#define DNLS_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define dnls_AXES 1 /* i */
#define dnls_DIM 2  /* fields of a site: q, p */
#define dnls_ORDER 4
#define dnls_CASIMIRS 0
#define dnls_PHIGEN_VERSION "0.1.0"
#define dnls_SPEC_SHA256 "5cde5645113223952e3b4a673969332fadcf80fc1a8985d29150efc71f64e2bb"

typedef struct {
    double beta; /* default 1.0 */
} dnls_params;

extern const dnls_params dnls_default_params;

enum { dnls_ARRAYS = 2 };        /* arrays over the sites: fields, then parameters */
enum { dnls_COEFFICIENTS = 52 }; /* numbers that depend on params and h only */

typedef enum { dnls_OK = 0, dnls_NO_CONVERGENCE, dnls_SINGULAR, dnls_NOT_FINITE,
    dnls_BAD_ARGUMENT } dnls_status;

/* The state is kept in memory of the caller.
   A field is a row: all its sites, with copies of the other end beside them.
   Set it up with dnls_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[dnls_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[dnls_ARRAYS];
    double *before[dnls_DIM]; /* the fields before the steps that are being made */
    int open;                 /* whether these lack the last flow of a step, which between calls x has made */
    size_t far;               /* steps to be made by functions for large arguments, where there are others */
    size_t steps;             /* good steps since dnls_init */
    double t;                 /* time since dnls_init */
    double h;                 /* the last step size */
    dnls_params params;
    double coef[dnls_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared; /* whether coef has been computed */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} dnls_solver;

/* The bytes that the solver of a lattice needs as its memory; 0 for sizes that are not allowed. */
size_t dnls_work_size(const size_t sizes[dnls_AXES]);

/* Start at x0[field][site], the last axis fastest, with dnls_work_size(sizes) bytes of memory, as from
   malloc, which must stay. params may be NULL for the defaults; its arrays are copied. dnls_BAD_ARGUMENT if
   sizes are not allowed, x0 or a parameter is not finite, or one that has to be positive is not. */
dnls_status dnls_init(dnls_solver *s, const dnls_params *params, const size_t sizes[dnls_AXES],
    const double *x0, void *work);

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good
   ones. Steps are joined, also those of several calls: where one ends as the next begins, both are one flow.
   With OpenMP rows are worked at in parallel, with the same bits for any number of threads. */
dnls_status dnls_step(dnls_solver *s, double h);
dnls_status dnls_integrate(dnls_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void dnls_state(const dnls_solver *s, double *x);

/* To go on elsewhere with the same bits: if dnls_saved is 1, x is what the next step begins with, for
   dnls_resume after dnls_init at the state. If it is 0, dnls_resume has NULL for x. */
int dnls_saved(const dnls_solver *s, double *x, size_t *far);
dnls_status dnls_resume(dnls_solver *s, double h, const double *x, size_t far);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double dnls_hamiltonian(const dnls_solver *s);
void dnls_density(const dnls_solver *s, double *out);
void dnls_casimirs(const dnls_solver *s, double *out);
void dnls_vector_field(const dnls_solver *s, double *out);

const char *dnls_status_string(dnls_status status);

/* For bindings: the size of dnls_solver, and its count of good steps. */
size_t dnls_solver_size(void);
size_t dnls_solver_steps_done(const dnls_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* DNLS_H */
