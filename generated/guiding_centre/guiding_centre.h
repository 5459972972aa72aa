/*
 * The declarations of guiding_centre.c. DO NOT EDIT: phigen detects changes by the checksum below.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: a7c5c4734f480e510f577f79bbbdc1e82d64fdaec82acdaf07af879897f980e6
 */
#ifndef GUIDING_CENTRE_H
#define GUIDING_CENTRE_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define guiding_centre_DIM 4      /* coordinates: x, y, z, u */
#define guiding_centre_ORDER 4    /* order of the method */
#define guiding_centre_CASIMIRS 0 /* Casimirs: none */
#define guiding_centre_PHIGEN_VERSION "0.1.0"
#define guiding_centre_SPEC_SHA256 "82d5ea90095e73077a2671c7c2e7b96d51802a2b6398fe46f5396c4225a32104"
enum { guiding_centre_STAGES = 5 };       /* number of stages of a step */
enum { guiding_centre_COEFFICIENTS = 5 }; /* number of coefficients: functions of params and h */
enum { guiding_centre_DIFFERENCES = 9 };  /* entries of the predictor; more would amplify rounding errors */

typedef struct {
    double kappa; /* twist of the field lines per unit of length */
    double mu;    /* magnetic moment */
    double k;     /* stiffness of the electric potential */
} guiding_centre_params;
extern const guiding_centre_params guiding_centre_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double guiding_centre_hamiltonian(const guiding_centre_params *params, const double x[4]);
void guiding_centre_casimirs(const guiding_centre_params *params, const double x[4], double out[]);
void guiding_centre_vector_field(const guiding_centre_params *params, const double x[4], double out[4]);

typedef enum { guiding_centre_OK = 0, guiding_centre_NO_CONVERGENCE, guiding_centre_SINGULAR,
    guiding_centre_NOT_FINITE, guiding_centre_BAD_ARGUMENT } guiding_centre_status;
const char *guiding_centre_status_string(guiding_centre_status status); /* the meaning of a status */

/* Predictor, which affects the speed only: the last solution and backward differences, for extrapolation. */
typedef struct {
    int count, order; /* number of stored entries, and number of entries whose sum is the prediction */
    /* the last solution, then its differences */
    double difference[guiding_centre_DIFFERENCES][guiding_centre_DIM];
} guiding_centre_history;

/* A copy of this struct is an independent solver. Arguments of functions may point into it, or overlap. */
typedef struct {
    double x[guiding_centre_DIM];     /* the state; change it only by the functions below */
    double carry[guiding_centre_DIM]; /* rounding error of x: x + carry is more accurate */
    size_t steps;                     /* number of successful steps since guiding_centre_init */
    size_t evaluations;               /* number of evaluations of the generating function, for statistics */
    double t;                         /* time since guiding_centre_init */
    double h;                         /* size of the last step; NaN before the first step */
    guiding_centre_params params;     /* the parameters, set by guiding_centre_init; do not change them */
    /* functions of params and h, computed when h changes */
    double coef[guiding_centre_STAGES][guiding_centre_COEFFICIENTS];
    size_t steps_before_h; /* steps and t at the last change of h: t = t_before_h + (steps since then) h */
    double t_before_h;
    /* predictor of the starting value of the iteration */
    guiding_centre_history history[guiding_centre_STAGES];
} guiding_centre_solver;
size_t guiding_centre_solver_size(void); /* in bytes, for languages that cannot read the struct */
size_t guiding_centre_solver_steps_done(const guiding_centre_solver *s);

/* Initialise *s with the state x0; params = NULL for the defaults. Returns guiding_centre_BAD_ARGUMENT, with
   *s unchanged, if a value or coefficient is not finite, or a parameter that must be positive is not. */
guiding_centre_status guiding_centre_init(guiding_centre_solver *s, const guiding_centre_params *params,
    const double x0[guiding_centre_DIM]);

/* Make steps of size h, of either sign. If a step fails, s->x and s->steps remain those before this step. */
guiding_centre_status guiding_centre_step(guiding_centre_solver *s, double h);
guiding_centre_status guiding_centre_integrate(guiding_centre_solver *s, double h, size_t steps);

/* Between steps: replace the state by x, or add `change` to the state. The values of Casimirs may change.
   Returns guiding_centre_BAD_ARGUMENT, with *s unchanged, if the new state is not finite. */
guiding_centre_status guiding_centre_set_state(guiding_centre_solver *s, const double x[guiding_centre_DIM]);
guiding_centre_status guiding_centre_kick(guiding_centre_solver *s, const double change[guiding_centre_DIM]);

/* Integrate members in place: x[i * members + m] is coordinate i of member m. Failed members get their last
   good state. status[m] is for member m; `status` may be NULL. Returns the first status that is not OK. */
guiding_centre_status guiding_centre_ensemble(const guiding_centre_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* GUIDING_CENTRE_H */
