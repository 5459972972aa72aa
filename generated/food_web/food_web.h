/*
 * The declarations of food_web.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 3f8dedac4736d215dc38727b668fb39e2c255b4a88aed5000584d4f6b9a4cf83
 */
#ifndef FOOD_WEB_H
#define FOOD_WEB_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define food_web_AXES 1 /* i */
#define food_web_DIM 1  /* fields of a site: x */
#define food_web_ORDER 4
#define food_web_CASIMIRS 0
#define food_web_PHIGEN_VERSION "0.1.0"
#define food_web_SPEC_SHA256 "16de8419a3297fb765426a07b8e18fed9d20fb7f25dc58b93db682eba04bd5c3"

typedef struct {
    const double *A; /* at bonds: how much the eater gains; NULL for the default at all of them */
    const double *k; /* at sites: balance; NULL for the default at all of them */
} food_web_params;

extern const food_web_params food_web_default_params;

enum { food_web_ARRAYS = 2 };        /* arrays over the sites: fields, then parameters */
enum { food_web_COEFFICIENTS = 26 }; /* numbers that depend on params and h only */
enum { food_web_GATHERED = 1 };      /* sums over other sites that are held for each site */
enum { food_web_BOND_ARRAYS = 1 };   /* parameters at bonds */

typedef enum { food_web_OK = 0, food_web_NO_CONVERGENCE, food_web_SINGULAR, food_web_NOT_FINITE,
    food_web_BAD_ARGUMENT } food_web_status;

/* The state is kept in memory of the caller.
   A field is a row: all its sites.
   Set it up with food_web_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[food_web_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[food_web_ARRAYS];
    double *gathered[food_web_GATHERED]; /* sums over other sites, for each site */
    /* of each site the first of its bonds that begin there, then of those that end there */
    int *bonds, *middle;
    int *other, *number; /* of each of these the site at the other end, and the number of the bond */
    double *at_bonds[food_web_BOND_ARRAYS]; /* the values of each parameter at these */
    int *colours; /* of each site; no bond connects two sites of one colour */
    int colour_count, flows; /* colours, and flows from one end of a stage to the other */
    double *before[food_web_DIM]; /* the fields before the steps that are being made */
    int open; /* whether these lack the last flow of a step, which between calls x has made */
    size_t far; /* steps to be made by functions for large arguments, where there are others */
    size_t steps; /* good steps since food_web_init */
    double t; /* time since food_web_init */
    double h; /* the last step size */
    food_web_params params;
    double coef[food_web_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared; /* whether coef has been computed */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} food_web_solver;

/* The bonds of a graph: number k runs from site ends[2 * k] to another, ends[2 * k + 1], counted from 0. */
typedef struct {
    size_t count;
    const size_t *ends;
} food_web_bonds;

/* The bytes that the solver of a graph with so many sites and bonds needs as memory; 0 for too many. */
size_t food_web_work_size(const size_t sizes[food_web_AXES], size_t bonds);

/* Start at x0[field][site], with food_web_work_size(sizes, bonds->count) bytes of memory, as from malloc,
   which must stay. bonds may be NULL if there are none, params for the defaults; all arrays are copied.
   food_web_BAD_ARGUMENT if sizes are not allowed, a bond does not run between two different sites, x0 or a
   parameter is not finite, or one that has to be positive is not. */
food_web_status food_web_init(food_web_solver *s, const food_web_params *params,
    const size_t sizes[food_web_AXES], const food_web_bonds *bonds, const double *x0, void *work);

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good
   ones. Steps are joined, also those of several calls: where one ends as the next begins, both are one flow.
   With OpenMP rows are worked at in parallel, with the same bits for any number of threads. */
food_web_status food_web_step(food_web_solver *s, double h);
food_web_status food_web_integrate(food_web_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void food_web_state(const food_web_solver *s, double *x);

/* To go on elsewhere with the same bits: if food_web_saved is 1, x is what the next step begins with, for
   food_web_resume after food_web_init at the state. If it is 0, food_web_resume has NULL for x. */
int food_web_saved(const food_web_solver *s, double *x, size_t *far);
food_web_status food_web_resume(food_web_solver *s, double h, const double *x, size_t far);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double food_web_hamiltonian(const food_web_solver *s);
void food_web_density(const food_web_solver *s, double *out);
void food_web_casimirs(const food_web_solver *s, double *out);
void food_web_vector_field(const food_web_solver *s, double *out);

const char *food_web_status_string(food_web_status status);

/* For bindings: the size of food_web_solver, and its count of good steps. */
size_t food_web_solver_size(void);
size_t food_web_solver_steps_done(const food_web_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* FOOD_WEB_H */
