/*
 * The declarations of sir_final_size.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 3285bc5c9d470907b66c0698f9038fa86b2c0291b708ea60760e697f72a5b627
 */
#ifndef SIR_FINAL_SIZE_H
#define SIR_FINAL_SIZE_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define sir_final_size_DIM 3 /* coordinates: S, I, R */
#define sir_final_size_ORDER 4
#define sir_final_size_CASIMIRS 1 /* K */
#define sir_final_size_PHIGEN_VERSION "0.1.0"
#define sir_final_size_SPEC_SHA256 "7484c778f31ede239b94c4b0e42e17d8479ae32e0b1efc0469e7872614cbf00b"
enum { sir_final_size_COEFFICIENTS = 3 }; /* numbers that depend on params and h only */

typedef struct {
    double beta;  /* contacts per unit of time that infect */
    double gamma; /* rate of recovery */
} sir_final_size_params;
extern const sir_final_size_params sir_final_size_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double sir_final_size_hamiltonian(const sir_final_size_params *params, const double x[3]);
void sir_final_size_casimirs(const sir_final_size_params *params, const double x[3], double out[]);
void sir_final_size_vector_field(const sir_final_size_params *params, const double x[3], double out[3]);

typedef enum { sir_final_size_OK = 0, sir_final_size_NO_CONVERGENCE, sir_final_size_SINGULAR,
    sir_final_size_NOT_FINITE, sir_final_size_BAD_ARGUMENT } sir_final_size_status;
const char *sir_final_size_status_string(sir_final_size_status status);

enum { sir_final_size_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[sir_final_size_DIFFERENCES][sir_final_size_DIM];
} sir_final_size_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[sir_final_size_DIM];     /* the state; read it freely, change it only through functions */
    double carry[sir_final_size_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                     /* good steps since sir_final_size_init */
    size_t evaluations;               /* of the generating function, for statistics */
    double t;                         /* time since sir_final_size_init */
    double h;                         /* the last step size; NaN before the first step */
    sir_final_size_params params;
    double coef[sir_final_size_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    sir_final_size_history history; /* for starting guesses */
} sir_final_size_solver;
size_t sir_final_size_solver_size(void); /* for bindings to other languages, as what follows */
size_t sir_final_size_solver_steps_done(const sir_final_size_solver *s);

/* Start at x0. params may be NULL for the defaults. sir_final_size_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
sir_final_size_status sir_final_size_init(sir_final_size_solver *s, const sir_final_size_params *params,
    const double x0[sir_final_size_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
sir_final_size_status sir_final_size_step(sir_final_size_solver *s, double h);
sir_final_size_status sir_final_size_integrate(sir_final_size_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   sir_final_size_BAD_ARGUMENT. Either may leave the leaf. */
sir_final_size_status sir_final_size_set_state(sir_final_size_solver *s, const double x[sir_final_size_DIM]);
sir_final_size_status sir_final_size_kick(sir_final_size_solver *s, const double change[sir_final_size_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
sir_final_size_status sir_final_size_ensemble(const sir_final_size_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* SIR_FINAL_SIZE_H */
