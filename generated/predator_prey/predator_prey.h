/*
 * The declarations of predator_prey.c. DO NOT EDIT: phigen detects changes by the checksum below.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 3b8612939f94cf63141dae8312cdd9c71005af0e9e290eeec736908de9609dfa
 */
#ifndef PREDATOR_PREY_H
#define PREDATOR_PREY_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define predator_prey_DIM 2      /* coordinates: prey, predator */
#define predator_prey_ORDER 4    /* order of the method */
#define predator_prey_CASIMIRS 0 /* Casimirs: none */
#define predator_prey_PHIGEN_VERSION "0.1.0"
#define predator_prey_SPEC_SHA256 "68567398b4ba43e83320ab7370f0cc0065b496e42c92688e630cf74def14bede"
enum { predator_prey_COEFFICIENTS = 11 }; /* number of coefficients: functions of params and h */
enum { predator_prey_DIFFERENCES = 9 };   /* entries of the predictor; more would amplify rounding errors */

typedef struct {
    double growth; /* growth rate of the prey without predators */
    double attack; /* fraction of the prey lost per predator and per unit time */
    double gain;   /* births per predator, per prey and per unit time */
    double death;  /* death rate of the predators without prey */
} predator_prey_params;
extern const predator_prey_params predator_prey_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double predator_prey_hamiltonian(const predator_prey_params *params, const double x[2]);
void predator_prey_casimirs(const predator_prey_params *params, const double x[2], double out[]);
void predator_prey_vector_field(const predator_prey_params *params, const double x[2], double out[2]);

typedef enum { predator_prey_OK = 0, predator_prey_NO_CONVERGENCE, predator_prey_SINGULAR,
    predator_prey_NOT_FINITE, predator_prey_BAD_ARGUMENT } predator_prey_status;
const char *predator_prey_status_string(predator_prey_status status); /* the meaning of a status */

/* Predictor, which affects the speed only: the last solution and backward differences, for extrapolation. */
typedef struct {
    int count, order; /* number of stored entries, and number of entries whose sum is the prediction */
    /* the last solution, then its differences */
    double difference[predator_prey_DIFFERENCES][predator_prey_DIM];
} predator_prey_history;

/* A copy of this struct is an independent solver. Arguments of functions may point into it, or overlap. */
typedef struct {
    double x[predator_prey_DIM]; /* the state; change it only by the functions below */
    double carry[predator_prey_DIM]; /* rounding error of x: x + carry is more accurate */
    size_t steps; /* number of successful steps since predator_prey_init */
    size_t evaluations; /* number of evaluations of the generating function, for statistics */
    double t; /* time since predator_prey_init */
    double h; /* size of the last step; NaN before the first step */
    predator_prey_params params; /* the parameters, set by predator_prey_init; do not change them */
    double coef[predator_prey_COEFFICIENTS]; /* functions of params and h, computed when h changes */
    size_t steps_before_h; /* steps and t at the last change of h: t = t_before_h + (steps since then) h */
    double t_before_h;
    predator_prey_history history; /* predictor of the starting value of the iteration */
} predator_prey_solver;
size_t predator_prey_solver_size(void); /* in bytes, for languages that cannot read the struct */
size_t predator_prey_solver_steps_done(const predator_prey_solver *s);

/* Initialise *s with the state x0; params = NULL for the defaults. Returns predator_prey_BAD_ARGUMENT, with
   *s unchanged, if a value or coefficient is not finite, or a parameter that must be positive is not. */
predator_prey_status predator_prey_init(predator_prey_solver *s, const predator_prey_params *params,
    const double x0[predator_prey_DIM]);

/* Make steps of size h, of either sign. If a step fails, s->x and s->steps remain those before this step. */
predator_prey_status predator_prey_step(predator_prey_solver *s, double h);
predator_prey_status predator_prey_integrate(predator_prey_solver *s, double h, size_t steps);

/* Between steps: replace the state by x, or add `change` to the state. The values of Casimirs may change.
   Returns predator_prey_BAD_ARGUMENT, with *s unchanged, if the new state is not finite. */
predator_prey_status predator_prey_set_state(predator_prey_solver *s, const double x[predator_prey_DIM]);
predator_prey_status predator_prey_kick(predator_prey_solver *s, const double change[predator_prey_DIM]);

/* Integrate members in place: x[i * members + m] is coordinate i of member m. Failed members get their last
   good state. status[m] is for member m; `status` may be NULL. Returns the first status that is not OK. */
predator_prey_status predator_prey_ensemble(const predator_prey_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* PREDATOR_PREY_H */
