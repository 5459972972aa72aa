/*
 * The declarations of toda3.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 7885e4f0e2ce93ee945ff1fdc1e2ce05a45c5c4102e00ff67b7e2d3d044d0638
 */
#ifndef TODA3_H
#define TODA3_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define toda3_DIM 5 /* coordinates: a1, a2, b1, b2, b3 */
#define toda3_ORDER 4
#define toda3_CASIMIRS 1 /* C */
#define toda3_PHIGEN_VERSION "0.1.0"
#define toda3_SPEC_SHA256 "813743f0c214e25a500552f5cc291b9b59649d4122a822c50e413b8a48c6bba9"
enum { toda3_COEFFICIENTS = 10 }; /* numbers that depend on params and h only */

typedef struct {
    char unused; /* this system has no parameters */
} toda3_params;
extern const toda3_params toda3_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double toda3_hamiltonian(const toda3_params *params, const double x[5]);
void toda3_casimirs(const toda3_params *params, const double x[5], double out[]);
void toda3_vector_field(const toda3_params *params, const double x[5], double out[5]);

typedef enum { toda3_OK = 0, toda3_NO_CONVERGENCE, toda3_SINGULAR, toda3_NOT_FINITE,
    toda3_BAD_ARGUMENT } toda3_status;
const char *toda3_status_string(toda3_status status);

enum { toda3_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[toda3_DIFFERENCES][toda3_DIM];
} toda3_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[toda3_DIM];     /* the state; read it freely, change it only through functions */
    double carry[toda3_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;            /* good steps since toda3_init */
    size_t evaluations;      /* of the generating function, for statistics */
    double t;                /* time since toda3_init */
    double h;                /* the last step size; NaN before the first step */
    toda3_params params;
    double coef[toda3_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    toda3_history history; /* for starting guesses */
} toda3_solver;
size_t toda3_solver_size(void); /* for bindings to other languages, as what follows */
size_t toda3_solver_steps_done(const toda3_solver *s);

/* Start at x0. params may be NULL for the defaults. toda3_BAD_ARGUMENT, and *s as before, if x0, a parameter
   or what follows from parameters alone is not finite, or one not positive that has to be. */
toda3_status toda3_init(toda3_solver *s, const toda3_params *params, const double x0[toda3_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
toda3_status toda3_step(toda3_solver *s, double h);
toda3_status toda3_integrate(toda3_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on toda3_BAD_ARGUMENT. Either
   may leave the leaf. */
toda3_status toda3_set_state(toda3_solver *s, const double x[toda3_DIM]);
toda3_status toda3_kick(toda3_solver *s, const double change[toda3_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
toda3_status toda3_ensemble(const toda3_params *params, double *x, size_t members, double h, size_t steps,
    unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* TODA3_H */
