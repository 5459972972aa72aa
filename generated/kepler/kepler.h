/*
 * The declarations of kepler.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 0a4c5d2378a1ad1f19505d7fb4092cf73d6ebbcb79fefa5007b0c570ea3ffa02
 */
#ifndef KEPLER_H
#define KEPLER_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define kepler_DIM 4 /* coordinates: x, y, px, py */
#define kepler_ORDER 6
#define kepler_CASIMIRS 0
#define kepler_PHIGEN_VERSION "0.1.0"
#define kepler_SPEC_SHA256 "7d889f3f1aeb8f2269b42200556d64daeb9a92956762d91c1f8a8d00d84f48f2"
enum { kepler_COEFFICIENTS = 118 }; /* numbers that depend on params and h only */

typedef struct {
    double mu; /* gravitational parameter of the centre */
} kepler_params;
extern const kepler_params kepler_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double kepler_hamiltonian(const kepler_params *params, const double x[4]);
void kepler_casimirs(const kepler_params *params, const double x[4], double out[]);
void kepler_vector_field(const kepler_params *params, const double x[4], double out[4]);

typedef enum { kepler_OK = 0, kepler_NO_CONVERGENCE, kepler_SINGULAR, kepler_NOT_FINITE,
    kepler_BAD_ARGUMENT } kepler_status;
const char *kepler_status_string(kepler_status status);

enum { kepler_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[kepler_DIFFERENCES][kepler_DIM];
} kepler_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[kepler_DIM];     /* the state; read it freely, change it only through functions */
    double carry[kepler_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;             /* good steps since kepler_init */
    size_t evaluations;       /* of the generating function, for statistics */
    double t;                 /* time since kepler_init */
    double h;                 /* the last step size; NaN before the first step */
    kepler_params params;
    double coef[kepler_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    kepler_history history; /* for starting guesses */
} kepler_solver;
size_t kepler_solver_size(void); /* for bindings to other languages, as what follows */
size_t kepler_solver_steps_done(const kepler_solver *s);

/* Start at x0. params may be NULL for the defaults. kepler_BAD_ARGUMENT, and *s as before, if x0, a parameter
   or what follows from parameters alone is not finite, or one not positive that has to be. */
kepler_status kepler_init(kepler_solver *s, const kepler_params *params, const double x0[kepler_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
kepler_status kepler_step(kepler_solver *s, double h);
kepler_status kepler_integrate(kepler_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on kepler_BAD_ARGUMENT. Either
   may leave the leaf. */
kepler_status kepler_set_state(kepler_solver *s, const double x[kepler_DIM]);
kepler_status kepler_kick(kepler_solver *s, const double change[kepler_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
kepler_status kepler_ensemble(const kepler_params *params, double *x, size_t members, double h, size_t steps,
    unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* KEPLER_H */
