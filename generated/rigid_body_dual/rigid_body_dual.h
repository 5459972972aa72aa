/*
 * The declarations of rigid_body_dual.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: b36d5a2adfe262201d7039634bb0af5f5407e4e19925c29981381076b4d5843f
 */
#ifndef RIGID_BODY_DUAL_H
#define RIGID_BODY_DUAL_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define rigid_body_dual_DIM 3 /* coordinates: x1, x2, x3 */
#define rigid_body_dual_ORDER 4
#define rigid_body_dual_CASIMIRS 1 /* C */
#define rigid_body_dual_PHIGEN_VERSION "0.1.0"
#define rigid_body_dual_SPEC_SHA256 "e8342777c4b6b547dcc62fa6d2e3aaf07e52570aa2174b60c461d6c56ed43f1b"
enum { rigid_body_dual_COEFFICIENTS = 12 }; /* numbers that depend on params and h only */
enum { rigid_body_dual_GAUGES = 1 };        /* Casimirs whose multiples are taken from H: C */

typedef struct {
    double I1; /* first principal moment of inertia */
    double I2; /* second principal moment of inertia */
    double I3; /* third principal moment of inertia */
} rigid_body_dual_params;
extern const rigid_body_dual_params rigid_body_dual_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double rigid_body_dual_hamiltonian(const rigid_body_dual_params *params, const double x[3]);
void rigid_body_dual_casimirs(const rigid_body_dual_params *params, const double x[3], double out[]);
void rigid_body_dual_vector_field(const rigid_body_dual_params *params, const double x[3], double out[3]);

typedef enum { rigid_body_dual_OK = 0, rigid_body_dual_NO_CONVERGENCE, rigid_body_dual_SINGULAR,
    rigid_body_dual_NOT_FINITE, rigid_body_dual_BAD_ARGUMENT } rigid_body_dual_status;
const char *rigid_body_dual_status_string(rigid_body_dual_status status);

enum { rigid_body_dual_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[rigid_body_dual_DIFFERENCES][rigid_body_dual_DIM];
} rigid_body_dual_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[rigid_body_dual_DIM];     /* the state; read it freely, change it only through functions */
    double carry[rigid_body_dual_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                      /* good steps since rigid_body_dual_init */
    size_t evaluations;                /* of the generating function, for statistics */
    double t;                          /* time since rigid_body_dual_init */
    double h;                          /* the last step size; NaN before the first step */
    rigid_body_dual_params params;
    double gauge[rigid_body_dual_GAUGES]; /* multiples of Casimirs that are taken from H, in their order */
    double coef[rigid_body_dual_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    rigid_body_dual_history history; /* for starting guesses */
} rigid_body_dual_solver;
size_t rigid_body_dual_solver_size(void); /* for bindings to other languages, as what follows */
size_t rigid_body_dual_solver_steps_done(const rigid_body_dual_solver *s);

/* Start at x0. params may be NULL for the defaults. rigid_body_dual_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
rigid_body_dual_status rigid_body_dual_init(rigid_body_dual_solver *s, const rigid_body_dual_params *params,
    const double x0[rigid_body_dual_DIM]);

/* Start at x0 with a gauge of one's own: the step is an exact Poisson map for each fixed gauge. */
rigid_body_dual_status rigid_body_dual_init_gauge(rigid_body_dual_solver *s,
    const rigid_body_dual_params *params, const double x0[rigid_body_dual_DIM],
    const double gauge[rigid_body_dual_GAUGES]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
rigid_body_dual_status rigid_body_dual_step(rigid_body_dual_solver *s, double h);
rigid_body_dual_status rigid_body_dual_integrate(rigid_body_dual_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   rigid_body_dual_BAD_ARGUMENT. Either may leave the leaf. */
rigid_body_dual_status rigid_body_dual_set_state(rigid_body_dual_solver *s,
    const double x[rigid_body_dual_DIM]);
rigid_body_dual_status rigid_body_dual_kick(rigid_body_dual_solver *s,
    const double change[rigid_body_dual_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
rigid_body_dual_status rigid_body_dual_ensemble(const rigid_body_dual_params *params, double *x,
    size_t members, double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* RIGID_BODY_DUAL_H */
