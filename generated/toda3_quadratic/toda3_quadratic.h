/*
 * The declarations of toda3_quadratic.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: e8fc1b404b523b5f7625139d80a92a6d043ff1c3bb1acc221165979f804c82f0
 */
#ifndef TODA3_QUADRATIC_H
#define TODA3_QUADRATIC_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define toda3_quadratic_DIM 5 /* coordinates: a1, a2, b1, b2, b3 */
#define toda3_quadratic_ORDER 4
#define toda3_quadratic_CASIMIRS 1 /* det */
#define toda3_quadratic_PHIGEN_VERSION "0.1.0"
#define toda3_quadratic_SPEC_SHA256 "7af77757733d7da7009fd5c930b7974289267141d3afbc870017a911873e4cad"
enum { toda3_quadratic_COEFFICIENTS = 1 }; /* numbers that depend on params and h only */
enum { toda3_quadratic_REMEMBERED = 112 }; /* values that a recurrence is fitted to */
enum { toda3_quadratic_WINDOW = 40 };      /* of them that it may use */
enum { toda3_quadratic_AHEAD = 1 };        /* values that it foresees */

typedef struct {
    char unused; /* this system has no parameters */
} toda3_quadratic_params;
extern const toda3_quadratic_params toda3_quadratic_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double toda3_quadratic_hamiltonian(const toda3_quadratic_params *params, const double x[5]);
void toda3_quadratic_casimirs(const toda3_quadratic_params *params, const double x[5], double out[]);
void toda3_quadratic_vector_field(const toda3_quadratic_params *params, const double x[5], double out[5]);

typedef enum { toda3_quadratic_OK = 0, toda3_quadratic_NO_CONVERGENCE, toda3_quadratic_SINGULAR,
    toda3_quadratic_NOT_FINITE, toda3_quadratic_BAD_ARGUMENT } toda3_quadratic_status;
const char *toda3_quadratic_status_string(toda3_quadratic_status status);

enum { toda3_quadratic_KEPT = 2 * toda3_quadratic_REMEMBERED };

/* Recent values of the unknown of the inner solve, for its starting guess: extrapolated, or by a linear
   recurrence fitted to the last toda3_quadratic_REMEMBERED values. For speed only. */
typedef struct {
    int count; /* values in past */
    int extrapolation_order; /* how many of them the extrapolation uses */
    int recurrence_terms; /* how many of them the recurrence uses; 0 if there is none */
    int use_recurrence; /* whether the recurrence is the better guess */
    int fits; /* how often it has been fitted */
    int slow_steps; /* how many of the last steps took more than one iteration */
    int slow_steps_allowed; /* how many of those before it is fitted again */
    double past[toda3_quadratic_KEPT][toda3_quadratic_DIM]; /* values, the latest last */
    /* of past values, the latest first, for the next */
    double weight[toda3_quadratic_WINDOW][toda3_quadratic_DIM][toda3_quadratic_AHEAD];
} toda3_quadratic_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[toda3_quadratic_DIM];     /* the state; read it freely, change it only through functions */
    double carry[toda3_quadratic_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                      /* good steps since toda3_quadratic_init */
    size_t evaluations;                /* of the generating function, for statistics */
    double t;                          /* time since toda3_quadratic_init */
    double h;                          /* the last step size; NaN before the first step */
    toda3_quadratic_params params;
    double coef[toda3_quadratic_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    toda3_quadratic_history history; /* for starting guesses */
} toda3_quadratic_solver;
size_t toda3_quadratic_solver_size(void); /* for bindings to other languages, as what follows */
size_t toda3_quadratic_solver_steps_done(const toda3_quadratic_solver *s);

/* Start at x0. params may be NULL for the defaults. toda3_quadratic_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
toda3_quadratic_status toda3_quadratic_init(toda3_quadratic_solver *s, const toda3_quadratic_params *params,
    const double x0[toda3_quadratic_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
toda3_quadratic_status toda3_quadratic_step(toda3_quadratic_solver *s, double h);
toda3_quadratic_status toda3_quadratic_integrate(toda3_quadratic_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   toda3_quadratic_BAD_ARGUMENT. Either may leave the leaf. */
toda3_quadratic_status toda3_quadratic_set_state(toda3_quadratic_solver *s,
    const double x[toda3_quadratic_DIM]);
toda3_quadratic_status toda3_quadratic_kick(toda3_quadratic_solver *s,
    const double change[toda3_quadratic_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
toda3_quadratic_status toda3_quadratic_ensemble(const toda3_quadratic_params *params, double *x,
    size_t members, double h, size_t steps, unsigned char *status);

/* The same where each member has its own parameters params[m] and step h[m]; params may be NULL. */
/* frames (or NULL) receives the states after every stride-th step: frames[(k * toda3_quadratic_DIM + i) *
   members + m] is coordinate i of member m after (k + 1) * stride steps, NaN if it failed before. Arrays must
   not overlap. */
toda3_quadratic_status toda3_quadratic_ensemble_each(const toda3_quadratic_params *params, double *x,
    size_t members, const double *h, size_t steps, size_t stride, double *frames, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* TODA3_QUADRATIC_H */
