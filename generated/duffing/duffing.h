/*
 * The declarations of duffing.c. DO NOT EDIT: phigen detects changes by the checksum below.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 260829a76c39eab408b55754ba863a47bd5e2c54037b2943c859103f6616778f
 */
#ifndef DUFFING_H
#define DUFFING_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define duffing_DIM 2      /* coordinates: q, p */
#define duffing_ORDER 6    /* order of the method */
#define duffing_CASIMIRS 0 /* Casimirs: none */
#define duffing_PHIGEN_VERSION "0.1.0"
#define duffing_SPEC_SHA256 "ede43f8e6b701b5554dc52316d7c870d0e7f0b2ee5862a7290406e095a945c72"
enum { duffing_COEFFICIENTS = 33 }; /* number of coefficients: functions of params and h, and of the time */
enum { duffing_DIFFERENCES = 9 };   /* entries of the predictor; more would amplify rounding errors */

typedef struct {
    double A;     /* amplitude of the drive */
    double omega; /* frequency of the drive */
} duffing_params;
extern const duffing_params duffing_default_params;

/* The Hamiltonian at the time t; the Casimirs; the right-hand side pi(x) grad H(t, x). params may be NULL. */
double duffing_hamiltonian(const duffing_params *params, double t, const double x[2]);
void duffing_casimirs(const duffing_params *params, const double x[2], double out[]);
void duffing_vector_field(const duffing_params *params, double t, const double x[2], double out[2]);

typedef enum { duffing_OK = 0, duffing_NO_CONVERGENCE, duffing_SINGULAR, duffing_NOT_FINITE,
    duffing_BAD_ARGUMENT } duffing_status;
const char *duffing_status_string(duffing_status status); /* the meaning of a status */

/* Predictor, which affects the speed only: the last solution and backward differences, for extrapolation. */
typedef struct {
    int count, order; /* number of stored entries, and number of entries whose sum is the prediction */
    double difference[duffing_DIFFERENCES][duffing_DIM]; /* the last solution, then its differences */
} duffing_history;

/* A copy of this struct is an independent solver. Arguments of functions may point into it, or overlap. */
typedef struct {
    double x[duffing_DIM];     /* the state; change it only by the functions below */
    double carry[duffing_DIM]; /* rounding error of x: x + carry is more accurate */
    size_t steps;              /* number of successful steps since duffing_init */
    size_t evaluations;        /* number of evaluations of the generating function, for statistics */
    double t;                  /* the time of x */
    double h;                  /* size of the last step; NaN before the first step */
    duffing_params params;     /* the parameters, set by duffing_init; do not change them */
    /* functions of params and h; then those that also depend on the time */
    double coef[duffing_COEFFICIENTS];
    size_t steps_before_h; /* steps and t at the last change of h: t = t_before_h + (steps since then) h */
    double t_before_h;
    duffing_history history; /* predictor of the starting value of the iteration */
} duffing_solver;
size_t duffing_solver_size(void); /* in bytes, for languages that cannot read the struct */
size_t duffing_solver_steps_done(const duffing_solver *s);

/* Initialise *s with the state x0; params = NULL for the defaults. Returns duffing_BAD_ARGUMENT, with *s
   unchanged, if a value or coefficient is not finite, or a parameter that must be positive is not. */
duffing_status duffing_init(duffing_solver *s, const duffing_params *params, const double x0[duffing_DIM]);

/* As duffing_init, at the time t0; duffing_init starts at the time 0. */
duffing_status duffing_init_at(duffing_solver *s, const duffing_params *params, const double x0[duffing_DIM],
    double t0);

/* Make steps of size h, of either sign. If a step fails, s->x and s->steps remain those before this step. */
duffing_status duffing_step(duffing_solver *s, double h);
duffing_status duffing_integrate(duffing_solver *s, double h, size_t steps);

/* Between steps: replace the state by x, or add `change` to the state. The values of Casimirs may change.
   Returns duffing_BAD_ARGUMENT, with *s unchanged, if the new state is not finite. */
duffing_status duffing_set_state(duffing_solver *s, const double x[duffing_DIM]);
duffing_status duffing_kick(duffing_solver *s, const double change[duffing_DIM]);

/* Integrate members in place: x[i * members + m] is coordinate i of member m. Failed members get their last
   good state. status[m] is for member m; `status` may be NULL. Returns the first status that is not OK. */
duffing_status duffing_ensemble(const duffing_params *params, double *x, size_t members, double h,
    size_t steps, unsigned char *status);

/* As duffing_ensemble, from the time t0 on; duffing_ensemble starts at the time 0. */
duffing_status duffing_ensemble_at(const duffing_params *params, double *x, size_t members, double t0,
    double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* DUFFING_H */
