/*
 * The declarations of ablowitz_ladik.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: b2e8da5bc3dded7786535828e9d32c5dfaacbfa864bb2de5733290314d497a72
 */
#ifndef ABLOWITZ_LADIK_H
#define ABLOWITZ_LADIK_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define ablowitz_ladik_AXES 1 /* i */
#define ablowitz_ladik_DIM 2  /* fields of a site: x, y */
#define ablowitz_ladik_ORDER 4
#define ablowitz_ladik_CASIMIRS 0
#define ablowitz_ladik_PHIGEN_VERSION "0.1.0"
#define ablowitz_ladik_SPEC_SHA256 "fdcac05ca3267c8d72f9b764571bd16dc6325331ec1c10b08ff5e44d3ea449c7"

typedef struct {
    char unused; /* this system has no parameters */
} ablowitz_ladik_params;

extern const ablowitz_ladik_params ablowitz_ladik_default_params;

enum { ablowitz_ladik_ARRAYS = 2 };         /* arrays over the sites: fields, then parameters */
enum { ablowitz_ladik_COEFFICIENTS = 104 }; /* numbers that depend on params and h only */

typedef enum { ablowitz_ladik_OK = 0, ablowitz_ladik_NO_CONVERGENCE, ablowitz_ladik_SINGULAR,
    ablowitz_ladik_NOT_FINITE, ablowitz_ladik_BAD_ARGUMENT } ablowitz_ladik_status;

/* The state is kept in memory of the caller.
   A field is a row: all its sites, with copies of the other end beside them.
   Set it up with ablowitz_ladik_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[ablowitz_ladik_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[ablowitz_ladik_ARRAYS];
    double *before[ablowitz_ladik_DIM]; /* the fields before the steps that are being made */
    int open; /* whether these lack the last flow of a step, which between calls x has made */
    size_t far; /* steps to be made by functions for large arguments, where there are others */
    size_t steps; /* good steps since ablowitz_ladik_init */
    double t; /* time since ablowitz_ladik_init */
    double h; /* the last step size */
    ablowitz_ladik_params params;
    double coef[ablowitz_ladik_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared; /* whether coef has been computed */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} ablowitz_ladik_solver;

/* The bytes that the solver of a lattice needs as its memory; 0 for sizes that are not allowed. */
size_t ablowitz_ladik_work_size(const size_t sizes[ablowitz_ladik_AXES]);

/* Start at x0[field][site], the last axis fastest, with ablowitz_ladik_work_size(sizes) bytes of memory, as
   from malloc, which must stay. params may be NULL for the defaults; its arrays are copied.
   ablowitz_ladik_BAD_ARGUMENT if sizes are not allowed, x0 or a parameter is not finite, or one that has to
   be positive is not. */
ablowitz_ladik_status ablowitz_ladik_init(ablowitz_ladik_solver *s, const ablowitz_ladik_params *params,
    const size_t sizes[ablowitz_ladik_AXES], const double *x0, void *work);

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good
   ones. Steps are joined, also those of several calls: where one ends as the next begins, both are one flow.
   With OpenMP rows are worked at in parallel, with the same bits for any number of threads. */
ablowitz_ladik_status ablowitz_ladik_step(ablowitz_ladik_solver *s, double h);
ablowitz_ladik_status ablowitz_ladik_integrate(ablowitz_ladik_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void ablowitz_ladik_state(const ablowitz_ladik_solver *s, double *x);

/* To go on elsewhere with the same bits: if ablowitz_ladik_saved is 1, x is what the next step begins with,
   for ablowitz_ladik_resume after ablowitz_ladik_init at the state. If it is 0, ablowitz_ladik_resume has
   NULL for x. */
int ablowitz_ladik_saved(const ablowitz_ladik_solver *s, double *x, size_t *far);
ablowitz_ladik_status ablowitz_ladik_resume(ablowitz_ladik_solver *s, double h, const double *x, size_t far);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double ablowitz_ladik_hamiltonian(const ablowitz_ladik_solver *s);
void ablowitz_ladik_density(const ablowitz_ladik_solver *s, double *out);
void ablowitz_ladik_casimirs(const ablowitz_ladik_solver *s, double *out);
void ablowitz_ladik_vector_field(const ablowitz_ladik_solver *s, double *out);

const char *ablowitz_ladik_status_string(ablowitz_ladik_status status);

/* For bindings: the size of ablowitz_ladik_solver, and its count of good steps. */
size_t ablowitz_ladik_solver_size(void);
size_t ablowitz_ladik_solver_steps_done(const ablowitz_ladik_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* ABLOWITZ_LADIK_H */
