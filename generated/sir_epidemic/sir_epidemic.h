/*
 * The declarations of sir_epidemic.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: c241fddc438657c964f8e1f9d137ff89337afda207291ef0ebe02f8a9c475bfc
 */
#ifndef SIR_EPIDEMIC_H
#define SIR_EPIDEMIC_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define sir_epidemic_DIM 3 /* coordinates: S, I, R */
#define sir_epidemic_ORDER 4
#define sir_epidemic_CASIMIRS 1 /* N */
#define sir_epidemic_PHIGEN_VERSION "0.1.0"
#define sir_epidemic_SPEC_SHA256 "3cf6d26b9024102964d272d47dd11225be0d3e675077cabf3aa91f4af27a10e2"
enum { sir_epidemic_COEFFICIENTS = 4 }; /* numbers that depend on params and h only */

typedef struct {
    double beta;  /* contacts per unit of time that infect */
    double gamma; /* rate of recovery */
} sir_epidemic_params;
extern const sir_epidemic_params sir_epidemic_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double sir_epidemic_hamiltonian(const sir_epidemic_params *params, const double x[3]);
void sir_epidemic_casimirs(const sir_epidemic_params *params, const double x[3], double out[]);
void sir_epidemic_vector_field(const sir_epidemic_params *params, const double x[3], double out[3]);

typedef enum { sir_epidemic_OK = 0, sir_epidemic_NO_CONVERGENCE, sir_epidemic_SINGULAR,
    sir_epidemic_NOT_FINITE, sir_epidemic_BAD_ARGUMENT } sir_epidemic_status;
const char *sir_epidemic_status_string(sir_epidemic_status status);

enum { sir_epidemic_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[sir_epidemic_DIFFERENCES][sir_epidemic_DIM];
} sir_epidemic_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[sir_epidemic_DIM];     /* the state; read it freely, change it only through functions */
    double carry[sir_epidemic_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                   /* good steps since sir_epidemic_init */
    size_t evaluations;             /* of the generating function, for statistics */
    double t;                       /* time since sir_epidemic_init */
    double h;                       /* the last step size; NaN before the first step */
    sir_epidemic_params params;
    double coef[sir_epidemic_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    sir_epidemic_history history; /* for starting guesses */
} sir_epidemic_solver;
size_t sir_epidemic_solver_size(void); /* for bindings to other languages, as what follows */
size_t sir_epidemic_solver_steps_done(const sir_epidemic_solver *s);

/* Start at x0. params may be NULL for the defaults. sir_epidemic_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
sir_epidemic_status sir_epidemic_init(sir_epidemic_solver *s, const sir_epidemic_params *params,
    const double x0[sir_epidemic_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
sir_epidemic_status sir_epidemic_step(sir_epidemic_solver *s, double h);
sir_epidemic_status sir_epidemic_integrate(sir_epidemic_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on sir_epidemic_BAD_ARGUMENT.
   Either may leave the leaf. */
sir_epidemic_status sir_epidemic_set_state(sir_epidemic_solver *s, const double x[sir_epidemic_DIM]);
sir_epidemic_status sir_epidemic_kick(sir_epidemic_solver *s, const double change[sir_epidemic_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
sir_epidemic_status sir_epidemic_ensemble(const sir_epidemic_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* SIR_EPIDEMIC_H */
