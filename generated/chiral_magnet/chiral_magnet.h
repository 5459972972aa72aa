/*
 * The declarations of chiral_magnet.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 1c6068c813d06a2d27bc1a210a937d6f853d8cfeee3fae7c2fb7c9f1f2b3cbda
 */
#ifndef CHIRAL_MAGNET_H
#define CHIRAL_MAGNET_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define chiral_magnet_AXES 1 /* i */
#define chiral_magnet_DIM 3  /* fields of a site: x, y, z */
#define chiral_magnet_ORDER 2
#define chiral_magnet_CASIMIRS 1 /* C */
#define chiral_magnet_PHIGEN_VERSION "0.1.0"
#define chiral_magnet_SPEC_SHA256 "951098f106e3e9505e7b54f47119d35c2adcfdd59783776db46bd20c3077d190"

typedef struct {
    double J;         /* default 1.0 */
    double D;         /* default 0.5 */
    const double *Dx; /* at bonds: direction of D; NULL for the default at all of them */
    const double *Dy; /* at bonds: direction of D; NULL for the default at all of them */
    double K;         /* easy axis along z */
    double B;         /* default 0.15 */
} chiral_magnet_params;

extern const chiral_magnet_params chiral_magnet_default_params;

enum { chiral_magnet_ARRAYS = 3 };        /* arrays over the sites: fields, then parameters */
enum { chiral_magnet_COEFFICIENTS = 30 }; /* numbers that depend on params and h only */
enum { chiral_magnet_GATHERED = 1 };      /* sums over other sites that are held for each site */
enum { chiral_magnet_BOND_ARRAYS = 2 };   /* parameters at bonds */

typedef enum { chiral_magnet_OK = 0, chiral_magnet_NO_CONVERGENCE, chiral_magnet_SINGULAR,
    chiral_magnet_NOT_FINITE, chiral_magnet_BAD_ARGUMENT } chiral_magnet_status;

/* The state is kept in memory of the caller.
   A field is a row: all its sites.
   Set it up with chiral_magnet_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[chiral_magnet_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[chiral_magnet_ARRAYS];
    double *gathered[chiral_magnet_GATHERED]; /* sums over other sites, for each site */
    /* of each site the first of its bonds that begin there, then of those that end there */
    int *bonds, *middle;
    int *other, *number; /* of each of these the site at the other end, and the number of the bond */
    double *at_bonds[chiral_magnet_BOND_ARRAYS]; /* the values of each parameter at these */
    int *colours; /* of each site; no bond connects two sites of one colour */
    int colour_count, flows; /* colours, and flows from one end of a stage to the other */
    double *before[chiral_magnet_DIM]; /* the fields before the steps that are being made */
    int open; /* whether these lack the last flow of a step, which between calls x has made */
    size_t far; /* steps to be made by functions for large arguments, where there are others */
    size_t steps; /* good steps since chiral_magnet_init */
    double t; /* time since chiral_magnet_init */
    double h; /* the last step size */
    chiral_magnet_params params;
    double coef[chiral_magnet_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared; /* whether coef has been computed */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} chiral_magnet_solver;

/* The bonds of a graph: number k runs from site ends[2 * k] to another, ends[2 * k + 1], counted from 0. */
typedef struct {
    size_t count;
    const size_t *ends;
} chiral_magnet_bonds;

/* The bytes that the solver of a graph with so many sites and bonds needs as memory; 0 for too many. */
size_t chiral_magnet_work_size(const size_t sizes[chiral_magnet_AXES], size_t bonds);

/* Start at x0[field][site], with chiral_magnet_work_size(sizes, bonds->count) bytes of memory, as from
   malloc, which must stay. bonds may be NULL if there are none, params for the defaults; all arrays are
   copied. chiral_magnet_BAD_ARGUMENT if sizes are not allowed, a bond does not run between two different
   sites, x0 or a parameter is not finite, or one that has to be positive is not. */
chiral_magnet_status chiral_magnet_init(chiral_magnet_solver *s, const chiral_magnet_params *params,
    const size_t sizes[chiral_magnet_AXES], const chiral_magnet_bonds *bonds, const double *x0, void *work);

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good
   ones. Steps are joined, also those of several calls: where one ends as the next begins, both are one flow.
   With OpenMP rows are worked at in parallel, with the same bits for any number of threads. */
chiral_magnet_status chiral_magnet_step(chiral_magnet_solver *s, double h);
chiral_magnet_status chiral_magnet_integrate(chiral_magnet_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void chiral_magnet_state(const chiral_magnet_solver *s, double *x);

/* To go on elsewhere with the same bits: if chiral_magnet_saved is 1, x is what the next step begins with,
   for chiral_magnet_resume after chiral_magnet_init at the state. If it is 0, chiral_magnet_resume has NULL
   for x. */
int chiral_magnet_saved(const chiral_magnet_solver *s, double *x, size_t *far);
chiral_magnet_status chiral_magnet_resume(chiral_magnet_solver *s, double h, const double *x, size_t far);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double chiral_magnet_hamiltonian(const chiral_magnet_solver *s);
void chiral_magnet_density(const chiral_magnet_solver *s, double *out);
void chiral_magnet_casimirs(const chiral_magnet_solver *s, double *out);
void chiral_magnet_vector_field(const chiral_magnet_solver *s, double *out);

const char *chiral_magnet_status_string(chiral_magnet_status status);

/* For bindings: the size of chiral_magnet_solver, and its count of good steps. */
size_t chiral_magnet_solver_size(void);
size_t chiral_magnet_solver_steps_done(const chiral_magnet_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* CHIRAL_MAGNET_H */
