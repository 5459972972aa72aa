/*
 * The declarations of pendulum.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: db517fb8adbb408cf0911adea290b6a84893cdbc0cfe6fe85306f280735d164d
 */
#ifndef PENDULUM_H
#define PENDULUM_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define pendulum_DIM 2 /* coordinates: q, p */
#define pendulum_ORDER 6
#define pendulum_CASIMIRS 0
#define pendulum_PHIGEN_VERSION "0.1.0"
#define pendulum_SPEC_SHA256 "ed81622cda36680120729d820e279a981f65dfdd206a130f06fa0ab7a405c963"
enum { pendulum_COEFFICIENTS = 19 }; /* numbers that depend on params and h only */

typedef struct {
    double g; /* gravity over the length of the rod */
} pendulum_params;
extern const pendulum_params pendulum_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double pendulum_hamiltonian(const pendulum_params *params, const double x[2]);
void pendulum_casimirs(const pendulum_params *params, const double x[2], double out[]);
void pendulum_vector_field(const pendulum_params *params, const double x[2], double out[2]);

typedef enum { pendulum_OK = 0, pendulum_NO_CONVERGENCE, pendulum_SINGULAR, pendulum_NOT_FINITE,
    pendulum_BAD_ARGUMENT } pendulum_status;
const char *pendulum_status_string(pendulum_status status);

enum { pendulum_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[pendulum_DIFFERENCES][pendulum_DIM];
} pendulum_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[pendulum_DIM];     /* the state; read it freely, change it only through functions */
    double carry[pendulum_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;               /* good steps since pendulum_init */
    size_t evaluations;         /* of the generating function, for statistics */
    double t;                   /* time since pendulum_init */
    double h;                   /* the last step size; NaN before the first step */
    pendulum_params params;
    double coef[pendulum_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    pendulum_history history; /* for starting guesses */
} pendulum_solver;
size_t pendulum_solver_size(void); /* for bindings to other languages, as what follows */
size_t pendulum_solver_steps_done(const pendulum_solver *s);

/* Start at x0. params may be NULL for the defaults. pendulum_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
pendulum_status pendulum_init(pendulum_solver *s, const pendulum_params *params,
    const double x0[pendulum_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
pendulum_status pendulum_step(pendulum_solver *s, double h);
pendulum_status pendulum_integrate(pendulum_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on pendulum_BAD_ARGUMENT.
   Either may leave the leaf. */
pendulum_status pendulum_set_state(pendulum_solver *s, const double x[pendulum_DIM]);
pendulum_status pendulum_kick(pendulum_solver *s, const double change[pendulum_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
pendulum_status pendulum_ensemble(const pendulum_params *params, double *x, size_t members, double h,
    size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* PENDULUM_H */
