/*
 * The declarations of nonlinear_wave.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: cb65ae1c34ee01f4ba1e4d960a83df945909653ecca82cfedb549234e73301f4
 */
#ifndef NONLINEAR_WAVE_H
#define NONLINEAR_WAVE_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define nonlinear_wave_AXES 1 /* i */
#define nonlinear_wave_DIM 2  /* fields of a site: u, v */
#define nonlinear_wave_ORDER 4
#define nonlinear_wave_CASIMIRS 2 /* elongation, momentum */
#define nonlinear_wave_PHIGEN_VERSION "0.1.0"
#define nonlinear_wave_SPEC_SHA256 "f0c49779027b870cd3b3bcb19eb5389ff368b584889beabb43e7fb7cd9590295"

typedef struct {
    double beta; /* default 1.0 */
    double d;    /* spacing */
} nonlinear_wave_params;

extern const nonlinear_wave_params nonlinear_wave_default_params;

enum { nonlinear_wave_ARRAYS = 2 };        /* arrays over the sites: fields, then parameters */
enum { nonlinear_wave_COEFFICIENTS = 56 }; /* numbers that depend on params and h only */

typedef enum { nonlinear_wave_OK = 0, nonlinear_wave_NO_CONVERGENCE, nonlinear_wave_SINGULAR,
    nonlinear_wave_NOT_FINITE, nonlinear_wave_BAD_ARGUMENT } nonlinear_wave_status;

/* The state is kept in memory of the caller.
   A field is a row: all its sites, with copies of the other end beside them.
   Set it up with nonlinear_wave_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[nonlinear_wave_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[nonlinear_wave_ARRAYS];
    double *before[nonlinear_wave_DIM]; /* the fields before the steps that are being made */
    int open; /* whether these lack the last flow of a step, which between calls x has made */
    size_t far; /* steps to be made by functions for large arguments, where there are others */
    size_t steps; /* good steps since nonlinear_wave_init */
    double t; /* time since nonlinear_wave_init */
    double h; /* the last step size */
    nonlinear_wave_params params;
    double coef[nonlinear_wave_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared; /* whether coef has been computed */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} nonlinear_wave_solver;

/* The bytes that the solver of a lattice needs as its memory; 0 for sizes that are not allowed. */
size_t nonlinear_wave_work_size(const size_t sizes[nonlinear_wave_AXES]);

/* Start at x0[field][site], the last axis fastest, with nonlinear_wave_work_size(sizes) bytes of memory, as
   from malloc, which must stay. params may be NULL for the defaults; its arrays are copied.
   nonlinear_wave_BAD_ARGUMENT if sizes are not allowed, x0 or a parameter is not finite, or one that has to
   be positive is not. */
nonlinear_wave_status nonlinear_wave_init(nonlinear_wave_solver *s, const nonlinear_wave_params *params,
    const size_t sizes[nonlinear_wave_AXES], const double *x0, void *work);

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good
   ones. Steps are joined, also those of several calls: where one ends as the next begins, both are one flow.
   With OpenMP rows are worked at in parallel, with the same bits for any number of threads. */
nonlinear_wave_status nonlinear_wave_step(nonlinear_wave_solver *s, double h);
nonlinear_wave_status nonlinear_wave_integrate(nonlinear_wave_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void nonlinear_wave_state(const nonlinear_wave_solver *s, double *x);

/* To go on elsewhere with the same bits: if nonlinear_wave_saved is 1, x is what the next step begins with,
   for nonlinear_wave_resume after nonlinear_wave_init at the state. If it is 0, nonlinear_wave_resume has
   NULL for x. */
int nonlinear_wave_saved(const nonlinear_wave_solver *s, double *x, size_t *far);
nonlinear_wave_status nonlinear_wave_resume(nonlinear_wave_solver *s, double h, const double *x, size_t far);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double nonlinear_wave_hamiltonian(const nonlinear_wave_solver *s);
void nonlinear_wave_density(const nonlinear_wave_solver *s, double *out);
void nonlinear_wave_casimirs(const nonlinear_wave_solver *s, double *out);
void nonlinear_wave_vector_field(const nonlinear_wave_solver *s, double *out);

const char *nonlinear_wave_status_string(nonlinear_wave_status status);

/* For bindings: the size of nonlinear_wave_solver, and its count of good steps. */
size_t nonlinear_wave_solver_size(void);
size_t nonlinear_wave_solver_steps_done(const nonlinear_wave_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* NONLINEAR_WAVE_H */
