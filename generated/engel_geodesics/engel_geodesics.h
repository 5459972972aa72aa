/*
 * The declarations of engel_geodesics.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 141143b3d903d3ef92118f58f4a906d3b38969a59d671485b25cca8cc611969c
 */
#ifndef ENGEL_GEODESICS_H
#define ENGEL_GEODESICS_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define engel_geodesics_DIM 4 /* coordinates: h1, h2, h3, h4 */
#define engel_geodesics_ORDER 4
#define engel_geodesics_CASIMIRS 2 /* h4, C */
#define engel_geodesics_PHIGEN_VERSION "0.1.0"
#define engel_geodesics_SPEC_SHA256 "fb609c6d402d3a7fbfac0e7cda1d7e07e2dba9262c5dfd8f16d22d0ab34eeabc"
enum { engel_geodesics_COEFFICIENTS = 3 }; /* numbers that depend on params and h only */

typedef struct {
    char unused; /* this system has no parameters */
} engel_geodesics_params;
extern const engel_geodesics_params engel_geodesics_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double engel_geodesics_hamiltonian(const engel_geodesics_params *params, const double x[4]);
void engel_geodesics_casimirs(const engel_geodesics_params *params, const double x[4], double out[]);
void engel_geodesics_vector_field(const engel_geodesics_params *params, const double x[4], double out[4]);

typedef enum { engel_geodesics_OK = 0, engel_geodesics_NO_CONVERGENCE, engel_geodesics_SINGULAR,
    engel_geodesics_NOT_FINITE, engel_geodesics_BAD_ARGUMENT } engel_geodesics_status;
const char *engel_geodesics_status_string(engel_geodesics_status status);

enum { engel_geodesics_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[engel_geodesics_DIFFERENCES][engel_geodesics_DIM];
} engel_geodesics_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
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
size_t engel_geodesics_solver_size(void); /* for bindings to other languages, as what follows */
size_t engel_geodesics_solver_steps_done(const engel_geodesics_solver *s);

/* Start at x0. params may be NULL for the defaults. engel_geodesics_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
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

#ifdef __cplusplus
}
#endif
#endif /* ENGEL_GEODESICS_H */
