/*
 * The declarations of duffing.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 8f5f5b3be60a5f6f0c608439790011955db12c48089b5fddc161b8e7695802fe
 */
#ifndef DUFFING_H
#define DUFFING_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define duffing_DIM 2 /* coordinates: q, p */
#define duffing_ORDER 6
#define duffing_CASIMIRS 0
#define duffing_PHIGEN_VERSION "0.1.0"
#define duffing_SPEC_SHA256 "72ba392fccc406dfdc3b1d47b1172899f03878892236d624cb8d53a7a18b6c1c"
enum { duffing_COEFFICIENTS = 33 }; /* numbers that depend on params and h, and on the time */
enum { duffing_DIFFERENCES = 9 };   /* that a step is extrapolated from: more amplify rounding */

typedef struct {
    double A;     /* amplitude of the drive */
    double omega; /* its frequency */
} duffing_params;
extern const duffing_params duffing_default_params;

/* The Hamiltonian at the time t; the Casimirs; the right-hand side pi(x) grad H(t, x). params may be NULL. */
double duffing_hamiltonian(const duffing_params *params, double t, const double x[2]);
void duffing_casimirs(const duffing_params *params, const double x[2], double out[]);
void duffing_vector_field(const duffing_params *params, double t, const double x[2], double out[2]);

typedef enum { duffing_OK = 0, duffing_NO_CONVERGENCE, duffing_SINGULAR, duffing_NOT_FINITE,
    duffing_BAD_ARGUMENT } duffing_status;
const char *duffing_status_string(duffing_status status);

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[duffing_DIFFERENCES][duffing_DIM];
} duffing_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[duffing_DIM];     /* the state; read it freely, change it only through functions */
    double carry[duffing_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;              /* good steps since duffing_init */
    size_t evaluations;        /* of the generating function, for statistics */
    double t;                  /* the time of x */
    double h;                  /* the last step size; NaN before the first step */
    duffing_params params;
    /* what depends on params and h only, then on the time of the step as well */
    double coef[duffing_COEFFICIENTS];
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    duffing_history history; /* for starting guesses */
} duffing_solver;
size_t duffing_solver_size(void); /* for bindings to other languages, as what follows */
size_t duffing_solver_steps_done(const duffing_solver *s);

/* Start at x0. params may be NULL for the defaults. duffing_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
duffing_status duffing_init(duffing_solver *s, const duffing_params *params, const double x0[duffing_DIM]);

/* The same at the time t0, which duffing_init takes to be 0. */
duffing_status duffing_init_at(duffing_solver *s, const duffing_params *params, const double x0[duffing_DIM],
    double t0);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
duffing_status duffing_step(duffing_solver *s, double h);
duffing_status duffing_integrate(duffing_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on duffing_BAD_ARGUMENT.
   Either may leave the leaf. */
duffing_status duffing_set_state(duffing_solver *s, const double x[duffing_DIM]);
duffing_status duffing_kick(duffing_solver *s, const double change[duffing_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
duffing_status duffing_ensemble(const duffing_params *params, double *x, size_t members, double h,
    size_t steps, unsigned char *status);

/* The same from the time t0 of all members on, which duffing_ensemble takes to be 0. */
duffing_status duffing_ensemble_at(const duffing_params *params, double *x, size_t members, double t0,
    double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* DUFFING_H */
