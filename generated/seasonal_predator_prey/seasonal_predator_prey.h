/*
 * The declarations of seasonal_predator_prey.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: eea489d5b2afc67a7c5e7e5e2220645f2da791c2598a8b1c52c90f235572e0cc
 */
#ifndef SEASONAL_PREDATOR_PREY_H
#define SEASONAL_PREDATOR_PREY_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define seasonal_predator_prey_DIM 2 /* coordinates: x, y */
#define seasonal_predator_prey_ORDER 4
#define seasonal_predator_prey_CASIMIRS 0
#define seasonal_predator_prey_PHIGEN_VERSION "0.1.0"
#define seasonal_predator_prey_SPEC_SHA256 "6024fb8258a78f369b01d8e52272919642b4af3cf2bb32db98053ab4b6a20c9a"
enum { seasonal_predator_prey_COEFFICIENTS = 20 }; /* numbers that depend on params and h, and on the time */

typedef struct {
    double alpha;   /* growth of the prey */
    double beta;    /* default 1.0 */
    double gamma;   /* decay of the predator */
    double delta;   /* default 1.0 */
    double epsilon; /* strength of the seasons */
    double omega;   /* frequency of the seasons */
} seasonal_predator_prey_params;
extern const seasonal_predator_prey_params seasonal_predator_prey_default_params;

/* The Hamiltonian at the time t; the Casimirs; the right-hand side pi(x) grad H(t, x). params may be NULL. */
double seasonal_predator_prey_hamiltonian(const seasonal_predator_prey_params *params, double t,
    const double x[2]);
void seasonal_predator_prey_casimirs(const seasonal_predator_prey_params *params, const double x[2],
    double out[]);
void seasonal_predator_prey_vector_field(const seasonal_predator_prey_params *params, double t,
    const double x[2], double out[2]);

typedef enum { seasonal_predator_prey_OK = 0, seasonal_predator_prey_NO_CONVERGENCE,
    seasonal_predator_prey_SINGULAR, seasonal_predator_prey_NOT_FINITE,
    seasonal_predator_prey_BAD_ARGUMENT } seasonal_predator_prey_status;
const char *seasonal_predator_prey_status_string(seasonal_predator_prey_status status);

/* those of higher order amplify rounding more than they gain */
enum { seasonal_predator_prey_DIFFERENCES = 9 };

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[seasonal_predator_prey_DIFFERENCES][seasonal_predator_prey_DIM];
} seasonal_predator_prey_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    /* the state; read it freely, change it only through functions */
    double x[seasonal_predator_prey_DIM];
    double carry[seasonal_predator_prey_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                             /* good steps since seasonal_predator_prey_init */
    size_t evaluations;                       /* of the generating function, for statistics */
    double t;                                 /* the time of x */
    double h;                                 /* the last step size; NaN before the first step */
    seasonal_predator_prey_params params;
    /* what depends on params and h only, then on the time of the step as well */
    double coef[seasonal_predator_prey_COEFFICIENTS];
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    seasonal_predator_prey_history history; /* for starting guesses */
} seasonal_predator_prey_solver;
size_t seasonal_predator_prey_solver_size(void); /* for bindings to other languages, as what follows */
size_t seasonal_predator_prey_solver_steps_done(const seasonal_predator_prey_solver *s);

/* Start at x0. params may be NULL for the defaults. seasonal_predator_prey_BAD_ARGUMENT, and *s as before, if
   x0, a parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
seasonal_predator_prey_status seasonal_predator_prey_init(seasonal_predator_prey_solver *s,
    const seasonal_predator_prey_params *params, const double x0[seasonal_predator_prey_DIM]);

/* The same at the time t0, which seasonal_predator_prey_init takes to be 0. */
seasonal_predator_prey_status seasonal_predator_prey_init_at(seasonal_predator_prey_solver *s,
    const seasonal_predator_prey_params *params, const double x0[seasonal_predator_prey_DIM], double t0);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
seasonal_predator_prey_status seasonal_predator_prey_step(seasonal_predator_prey_solver *s, double h);
seasonal_predator_prey_status seasonal_predator_prey_integrate(seasonal_predator_prey_solver *s, double h,
    size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   seasonal_predator_prey_BAD_ARGUMENT. Either may leave the leaf. */
seasonal_predator_prey_status seasonal_predator_prey_set_state(seasonal_predator_prey_solver *s,
    const double x[seasonal_predator_prey_DIM]);
seasonal_predator_prey_status seasonal_predator_prey_kick(seasonal_predator_prey_solver *s,
    const double change[seasonal_predator_prey_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
seasonal_predator_prey_status seasonal_predator_prey_ensemble(const seasonal_predator_prey_params *params,
    double *x, size_t members, double h, size_t steps, unsigned char *status);

/* The same from the time t0 of all members on, which seasonal_predator_prey_ensemble takes to be 0. */
seasonal_predator_prey_status seasonal_predator_prey_ensemble_at(const seasonal_predator_prey_params *params,
    double *x, size_t members, double t0, double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* SEASONAL_PREDATOR_PREY_H */
