/*
 * The declarations of outer_planets.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 39cf556a3747bd57f76c99f1c423eca528acd3171406da65255ecbc0b4d95634
 */
#ifndef OUTER_PLANETS_H
#define OUTER_PLANETS_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define outer_planets_AXES 1 /* i */
#define outer_planets_DIM 6  /* fields of a site: x, y, z, px, py, pz */
#define outer_planets_ORDER 4
#define outer_planets_CASIMIRS 0
#define outer_planets_PHIGEN_VERSION "0.1.0"
#define outer_planets_SPEC_SHA256 "4872d6ba15e2cf42961dec733b70ccb6eb8874221d7c80170561b402f7c63524"

typedef struct {
    double G;        /* default 0.000295912208286 */
    const double *m; /* at sites: masses */
} outer_planets_params;

extern const outer_planets_params outer_planets_default_params;

enum { outer_planets_ARRAYS = 7 };        /* arrays over the sites: fields, then parameters */
enum { outer_planets_COEFFICIENTS = 28 }; /* numbers that depend on params and h only */
enum { outer_planets_GATHERED = 3 };      /* sums over other sites that are held for each site */

typedef enum { outer_planets_OK = 0, outer_planets_NO_CONVERGENCE, outer_planets_SINGULAR,
    outer_planets_NOT_FINITE, outer_planets_BAD_ARGUMENT } outer_planets_status;

/* The state is kept in memory of the caller.
   A field is a row: all its sites.
   Set it up with outer_planets_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[outer_planets_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[outer_planets_ARRAYS];
    double *gathered[outer_planets_GATHERED]; /* sums over other sites, for each site */
    double *before[outer_planets_DIM]; /* the fields before the steps that are being made */
    int open; /* whether these lack the last flow of a step, which between calls x has made */
    size_t far; /* steps to be made by functions for large arguments, where there are others */
    size_t steps; /* good steps since outer_planets_init */
    double t; /* time since outer_planets_init */
    double h; /* the last step size */
    outer_planets_params params;
    double coef[outer_planets_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared; /* whether coef has been computed */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} outer_planets_solver;

/* The bytes that the solver of a lattice needs as its memory; 0 for sizes that are not allowed. */
size_t outer_planets_work_size(const size_t sizes[outer_planets_AXES]);

/* Start at x0[field][site], the last axis fastest, with outer_planets_work_size(sizes) bytes of memory, as
   from malloc, which must stay. params may be NULL for the defaults; its arrays are copied.
   outer_planets_BAD_ARGUMENT if sizes are not allowed, x0 or a parameter is not finite, or one that has to be
   positive is not. */
outer_planets_status outer_planets_init(outer_planets_solver *s, const outer_planets_params *params,
    const size_t sizes[outer_planets_AXES], const double *x0, void *work);

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good
   ones. Steps are joined, also those of several calls: where one ends as the next begins, both are one flow.
   With OpenMP rows are worked at in parallel, with the same bits for any number of threads. */
outer_planets_status outer_planets_step(outer_planets_solver *s, double h);
outer_planets_status outer_planets_integrate(outer_planets_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void outer_planets_state(const outer_planets_solver *s, double *x);

/* To go on elsewhere with the same bits: if outer_planets_saved is 1, x is what the next step begins with,
   for outer_planets_resume after outer_planets_init at the state. If it is 0, outer_planets_resume has NULL
   for x. */
int outer_planets_saved(const outer_planets_solver *s, double *x, size_t *far);
outer_planets_status outer_planets_resume(outer_planets_solver *s, double h, const double *x, size_t far);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double outer_planets_hamiltonian(const outer_planets_solver *s);
void outer_planets_density(const outer_planets_solver *s, double *out);
void outer_planets_casimirs(const outer_planets_solver *s, double *out);
void outer_planets_vector_field(const outer_planets_solver *s, double *out);

const char *outer_planets_status_string(outer_planets_status status);

/* For bindings: the size of outer_planets_solver, and its count of good steps. */
size_t outer_planets_solver_size(void);
size_t outer_planets_solver_steps_done(const outer_planets_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* OUTER_PLANETS_H */
