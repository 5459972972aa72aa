/*
 * engel_geodesics.h: the declarations; engel_geodesics.c says how they were made.
 * DO NOT EDIT: edits are noticed by the checksum below.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: b3254bb7c7135383e1b78fa7fcda8dca5300621f7dd08ab799e681a31e45c093
 */
#ifndef ENGEL_GEODESICS_H
#define ENGEL_GEODESICS_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define engel_geodesics_DIM 4
#define engel_geodesics_ORDER 4
#define engel_geodesics_CASIMIRS 2
#define engel_geodesics_PHIGEN_VERSION "0.1.0"
#define engel_geodesics_SPEC_SHA256 "fb609c6d402d3a7fbfac0e7cda1d7e07e2dba9262c5dfd8f16d22d0ab34eeabc"
enum { engel_geodesics_COEFFICIENTS = 3 }; /* numbers that depend on params and h only */

/* State vectors: h1, h2, h3, h4. Casimirs: h4, C. */
typedef struct {
    char unused; /* this system has no parameters */
} engel_geodesics_params;
extern const engel_geodesics_params engel_geodesics_default_params;

/* How a step ends; engel_geodesics_status_string says it in words. */
typedef enum { engel_geodesics_OK = 0, engel_geodesics_NO_CONVERGENCE, engel_geodesics_SINGULAR,
    engel_geodesics_NOT_FINITE, engel_geodesics_BAD_ARGUMENT } engel_geodesics_status;
const char *engel_geodesics_status_string(engel_geodesics_status status);

enum { engel_geodesics_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[engel_geodesics_DIFFERENCES][engel_geodesics_DIM];
} engel_geodesics_history;

/* The solver is a plain value: copy it to branch, keep one per thread. Set it up with
   engel_geodesics_init. */
typedef struct {
    double x[engel_geodesics_DIM];     /* the state; read it freely, change it only through functions */
    double carry[engel_geodesics_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                      /* good steps since engel_geodesics_init */
    size_t evaluations;                /* of the generating function, for statistics */
    double t;                          /* time since engel_geodesics_init */
    double h;                          /* the last step size; NaN before the first step */
    engel_geodesics_params params;
    double coef[engel_geodesics_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    engel_geodesics_history history; /* for starting guesses */
} engel_geodesics_solver;

/* Start at x0. params may be NULL for the defaults. Arguments of all functions may be parts of the solver, or
   overlap. engel_geodesics_BAD_ARGUMENT, and *s as before, if x0 or a parameter is not finite, one that has
   to be positive is not, or what is computed from parameters alone is not finite. */
engel_geodesics_status engel_geodesics_init(engel_geodesics_solver *s, const engel_geodesics_params *params,
    const double x0[engel_geodesics_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
engel_geodesics_status engel_geodesics_step(engel_geodesics_solver *s, double h);
engel_geodesics_status engel_geodesics_integrate(engel_geodesics_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   engel_geodesics_BAD_ARGUMENT. Either may leave the leaf. */
engel_geodesics_status engel_geodesics_set_state(engel_geodesics_solver *s,
    const double x[engel_geodesics_DIM]);
engel_geodesics_status engel_geodesics_kick(engel_geodesics_solver *s,
    const double change[engel_geodesics_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
engel_geodesics_status engel_geodesics_ensemble(const engel_geodesics_params *params, double *x,
    size_t members, double h, size_t steps, unsigned char *status);

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double engel_geodesics_hamiltonian(const engel_geodesics_params *params, const double x[engel_geodesics_DIM]);
void engel_geodesics_casimirs(const engel_geodesics_params *params, const double x[engel_geodesics_DIM],
    double out[]);
void engel_geodesics_vector_field(const engel_geodesics_params *params, const double x[engel_geodesics_DIM],
    double out[engel_geodesics_DIM]);

/* For bindings: the size of engel_geodesics_solver, and its count of good steps. */
size_t engel_geodesics_solver_size(void);
size_t engel_geodesics_solver_steps_done(const engel_geodesics_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* ENGEL_GEODESICS_H */
