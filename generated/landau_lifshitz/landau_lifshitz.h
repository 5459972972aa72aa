/*
 * The declarations of landau_lifshitz.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 8817d6033495eaa8531f44971fa69fde89c9a2de6f5585f71075455493c5c533
 */
#ifndef LANDAU_LIFSHITZ_H
#define LANDAU_LIFSHITZ_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define landau_lifshitz_DIM 3 /* coordinates: x, y, z */
#define landau_lifshitz_ORDER 4
#define landau_lifshitz_CASIMIRS 1 /* length */
#define landau_lifshitz_PHIGEN_VERSION "0.1.0"
#define landau_lifshitz_SPEC_SHA256 "0ace50d0804c6bcf96c22e3ce0adf1306322d767826930130168365d5a0c1cdd"
enum { landau_lifshitz_STAGES = 5 };       /* of a step */
enum { landau_lifshitz_COEFFICIENTS = 6 }; /* numbers that depend on params and h only */

typedef struct {
    double K;            /* anisotropy */
    double B;            /* field along -z */
    double damping_rate; /* of Landau and Lifshitz */
} landau_lifshitz_params;
extern const landau_lifshitz_params landau_lifshitz_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) (grad H(x) + zeta(x)) + f(x). params may be
   NULL. */
double landau_lifshitz_hamiltonian(const landau_lifshitz_params *params, const double x[3]);
void landau_lifshitz_casimirs(const landau_lifshitz_params *params, const double x[3], double out[]);
void landau_lifshitz_vector_field(const landau_lifshitz_params *params, const double x[3], double out[3]);

typedef enum { landau_lifshitz_OK = 0, landau_lifshitz_NO_CONVERGENCE, landau_lifshitz_SINGULAR,
    landau_lifshitz_NOT_FINITE, landau_lifshitz_BAD_ARGUMENT } landau_lifshitz_status;
const char *landau_lifshitz_status_string(landau_lifshitz_status status);

enum { landau_lifshitz_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[landau_lifshitz_DIFFERENCES][landau_lifshitz_DIM];
} landau_lifshitz_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[landau_lifshitz_DIM];     /* the state; read it freely, change it only through functions */
    double carry[landau_lifshitz_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                      /* good steps since landau_lifshitz_init */
    size_t evaluations;                /* of the generating function, for statistics */
    double t;                          /* time since landau_lifshitz_init */
    double h;                          /* the last step size; NaN before the first step */
    landau_lifshitz_params params;
    /* all that depends on params and h only */
    double coef[landau_lifshitz_STAGES][landau_lifshitz_COEFFICIENTS];
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    landau_lifshitz_history history[landau_lifshitz_STAGES]; /* for starting guesses */
} landau_lifshitz_solver;
size_t landau_lifshitz_solver_size(void); /* for bindings to other languages, as what follows */
size_t landau_lifshitz_solver_steps_done(const landau_lifshitz_solver *s);

/* Start at x0. params may be NULL for the defaults. landau_lifshitz_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
landau_lifshitz_status landau_lifshitz_init(landau_lifshitz_solver *s, const landau_lifshitz_params *params,
    const double x0[landau_lifshitz_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
landau_lifshitz_status landau_lifshitz_step(landau_lifshitz_solver *s, double h);
landau_lifshitz_status landau_lifshitz_integrate(landau_lifshitz_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   landau_lifshitz_BAD_ARGUMENT. Either may leave the leaf. */
landau_lifshitz_status landau_lifshitz_set_state(landau_lifshitz_solver *s,
    const double x[landau_lifshitz_DIM]);
landau_lifshitz_status landau_lifshitz_kick(landau_lifshitz_solver *s,
    const double change[landau_lifshitz_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
landau_lifshitz_status landau_lifshitz_ensemble(const landau_lifshitz_params *params, double *x,
    size_t members, double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* LANDAU_LIFSHITZ_H */
