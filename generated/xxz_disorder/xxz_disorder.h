/*
 * The declarations of xxz_disorder.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: c764bd6fd0d8f801e6f64320182744425d64d4999fda2294f3aa9e4b36b5525b
 */
#ifndef XXZ_DISORDER_H
#define XXZ_DISORDER_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define xxz_disorder_AXES 1 /* i */
#define xxz_disorder_DIM 3  /* fields of a site: x, y, z */
#define xxz_disorder_ORDER 4
#define xxz_disorder_CASIMIRS 1 /* C */
#define xxz_disorder_PHIGEN_VERSION "0.1.0"
#define xxz_disorder_SPEC_SHA256 "57aba2c6c3ad4f3008d97959f0a4311ced73e77cf7bc96f76a9bd9865ce837b8"

typedef struct {
    double J;        /* default 1.0 */
    double delta;    /* default 1.3 */
    const double *B; /* at sites: field along z */
} xxz_disorder_params;

extern const xxz_disorder_params xxz_disorder_default_params;

enum { xxz_disorder_ARRAYS = 4 };        /* arrays over the sites: fields, then parameters */
enum { xxz_disorder_COEFFICIENTS = 78 }; /* numbers that depend on params and h only */

typedef enum { xxz_disorder_OK = 0, xxz_disorder_NO_CONVERGENCE, xxz_disorder_SINGULAR,
    xxz_disorder_NOT_FINITE, xxz_disorder_BAD_ARGUMENT } xxz_disorder_status;

/* The state is kept in memory of the caller.
   A field is a row: all its sites, with copies of the other end beside them.
   Set it up with xxz_disorder_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[xxz_disorder_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[xxz_disorder_ARRAYS];
    double *before[xxz_disorder_DIM]; /* the fields before the steps that are being made */
    int open; /* whether these lack the last flow of a step, which between calls x has made */
    size_t far; /* steps to be made by functions for large arguments, where there are others */
    size_t steps; /* good steps since xxz_disorder_init */
    double t; /* time since xxz_disorder_init */
    double h; /* the last step size */
    xxz_disorder_params params;
    double coef[xxz_disorder_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared; /* whether coef has been computed */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} xxz_disorder_solver;

/* The bytes that the solver of a lattice needs as its memory; 0 for sizes that are not allowed. */
size_t xxz_disorder_work_size(const size_t sizes[xxz_disorder_AXES]);

/* Start at x0[field][site], the last axis fastest, with xxz_disorder_work_size(sizes) bytes of memory, as
   from malloc, which must stay. params may be NULL for the defaults; its arrays are copied.
   xxz_disorder_BAD_ARGUMENT if sizes are not allowed, x0 or a parameter is not finite, or one that has to be
   positive is not. */
xxz_disorder_status xxz_disorder_init(xxz_disorder_solver *s, const xxz_disorder_params *params,
    const size_t sizes[xxz_disorder_AXES], const double *x0, void *work);

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good
   ones. Steps are joined, also those of several calls: where one ends as the next begins, both are one flow.
   With OpenMP rows are worked at in parallel, with the same bits for any number of threads. */
xxz_disorder_status xxz_disorder_step(xxz_disorder_solver *s, double h);
xxz_disorder_status xxz_disorder_integrate(xxz_disorder_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void xxz_disorder_state(const xxz_disorder_solver *s, double *x);

/* To go on elsewhere with the same bits: if xxz_disorder_saved is 1, x is what the next step begins with, for
   xxz_disorder_resume after xxz_disorder_init at the state. If it is 0, xxz_disorder_resume has NULL for
   x. */
int xxz_disorder_saved(const xxz_disorder_solver *s, double *x, size_t *far);
xxz_disorder_status xxz_disorder_resume(xxz_disorder_solver *s, double h, const double *x, size_t far);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double xxz_disorder_hamiltonian(const xxz_disorder_solver *s);
void xxz_disorder_density(const xxz_disorder_solver *s, double *out);
void xxz_disorder_casimirs(const xxz_disorder_solver *s, double *out);
void xxz_disorder_vector_field(const xxz_disorder_solver *s, double *out);

const char *xxz_disorder_status_string(xxz_disorder_status status);

/* For bindings: the size of xxz_disorder_solver, and its count of good steps. */
size_t xxz_disorder_solver_size(void);
size_t xxz_disorder_solver_steps_done(const xxz_disorder_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* XXZ_DISORDER_H */
