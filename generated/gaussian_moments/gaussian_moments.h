/*
 * The declarations of gaussian_moments.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 7485c5ecbbf34d5a757df7d9720a075fc267441e50d68034cb1f08ba2e6f32ea
 */
#ifndef GAUSSIAN_MOMENTS_H
#define GAUSSIAN_MOMENTS_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define gaussian_moments_DIM 3 /* coordinates: a, b, c */
#define gaussian_moments_ORDER 6
#define gaussian_moments_CASIMIRS 1 /* area */
#define gaussian_moments_PHIGEN_VERSION "0.1.0"
#define gaussian_moments_SPEC_SHA256 "967874dae83dd8a6800d977c3a20ab90481f1a1e1820f485f001b0650f3fc9e7"
enum { gaussian_moments_COEFFICIENTS = 14 }; /* numbers that depend on params and h only */

typedef struct {
    double k; /* stiffness of the harmonic part */
    double g; /* strength of the quartic part */
} gaussian_moments_params;
extern const gaussian_moments_params gaussian_moments_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double gaussian_moments_hamiltonian(const gaussian_moments_params *params, const double x[3]);
void gaussian_moments_casimirs(const gaussian_moments_params *params, const double x[3], double out[]);
void gaussian_moments_vector_field(const gaussian_moments_params *params, const double x[3], double out[3]);

typedef enum { gaussian_moments_OK = 0, gaussian_moments_NO_CONVERGENCE, gaussian_moments_SINGULAR,
    gaussian_moments_NOT_FINITE, gaussian_moments_BAD_ARGUMENT } gaussian_moments_status;
const char *gaussian_moments_status_string(gaussian_moments_status status);

enum { gaussian_moments_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[gaussian_moments_DIFFERENCES][gaussian_moments_DIM];
} gaussian_moments_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[gaussian_moments_DIM];     /* the state; read it freely, change it only through functions */
    double carry[gaussian_moments_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                       /* good steps since gaussian_moments_init */
    size_t evaluations;                 /* of the generating function, for statistics */
    double t;                           /* time since gaussian_moments_init */
    double h;                           /* the last step size; NaN before the first step */
    gaussian_moments_params params;
    double coef[gaussian_moments_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    gaussian_moments_history history; /* for starting guesses */
} gaussian_moments_solver;
size_t gaussian_moments_solver_size(void); /* for bindings to other languages, as what follows */
size_t gaussian_moments_solver_steps_done(const gaussian_moments_solver *s);

/* Start at x0. params may be NULL for the defaults. gaussian_moments_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
gaussian_moments_status gaussian_moments_init(gaussian_moments_solver *s,
    const gaussian_moments_params *params, const double x0[gaussian_moments_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
gaussian_moments_status gaussian_moments_step(gaussian_moments_solver *s, double h);
gaussian_moments_status gaussian_moments_integrate(gaussian_moments_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   gaussian_moments_BAD_ARGUMENT. Either may leave the leaf. */
gaussian_moments_status gaussian_moments_set_state(gaussian_moments_solver *s,
    const double x[gaussian_moments_DIM]);
gaussian_moments_status gaussian_moments_kick(gaussian_moments_solver *s,
    const double change[gaussian_moments_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
gaussian_moments_status gaussian_moments_ensemble(const gaussian_moments_params *params, double *x,
    size_t members, double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* GAUSSIAN_MOMENTS_H */
