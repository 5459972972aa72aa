/*
 * The declarations of lagrange_top.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 861291653de24ccbc03a56aa01eb98dddad7955eb5fbc223f38ae78701a8679a
 */
#ifndef LAGRANGE_TOP_H
#define LAGRANGE_TOP_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define lagrange_top_DIM 6 /* coordinates: P1, P2, P3, G1, G2, G3 */
#define lagrange_top_ORDER 4
#define lagrange_top_CASIMIRS 2 /* A, B */
#define lagrange_top_PHIGEN_VERSION "0.1.0"
#define lagrange_top_SPEC_SHA256 "dc5faff4a3a290ee3b9329fcccd8fb8e506caefcd665168370fc76ae8622ea1f"
enum { lagrange_top_COEFFICIENTS = 8 }; /* numbers that depend on params and h only */

typedef struct {
    double I1;  /* moment of inertia about the first and second axes */
    double I3;  /* moment of inertia about the axis of symmetry */
    double mgl; /* weight times distance of the centre of mass from the fixed point */
} lagrange_top_params;
extern const lagrange_top_params lagrange_top_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double lagrange_top_hamiltonian(const lagrange_top_params *params, const double x[6]);
void lagrange_top_casimirs(const lagrange_top_params *params, const double x[6], double out[]);
void lagrange_top_vector_field(const lagrange_top_params *params, const double x[6], double out[6]);

typedef enum { lagrange_top_OK = 0, lagrange_top_NO_CONVERGENCE, lagrange_top_SINGULAR,
    lagrange_top_NOT_FINITE, lagrange_top_BAD_ARGUMENT } lagrange_top_status;
const char *lagrange_top_status_string(lagrange_top_status status);

enum { lagrange_top_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[lagrange_top_DIFFERENCES][lagrange_top_DIM];
} lagrange_top_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[lagrange_top_DIM];     /* the state; read it freely, change it only through functions */
    double carry[lagrange_top_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                   /* good steps since lagrange_top_init */
    size_t evaluations;             /* of the generating function, for statistics */
    double t;                       /* time since lagrange_top_init */
    double h;                       /* the last step size; NaN before the first step */
    lagrange_top_params params;
    double coef[lagrange_top_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    lagrange_top_history history; /* for starting guesses */
} lagrange_top_solver;
size_t lagrange_top_solver_size(void); /* for bindings to other languages, as what follows */
size_t lagrange_top_solver_steps_done(const lagrange_top_solver *s);

/* Start at x0. params may be NULL for the defaults. lagrange_top_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
lagrange_top_status lagrange_top_init(lagrange_top_solver *s, const lagrange_top_params *params,
    const double x0[lagrange_top_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
lagrange_top_status lagrange_top_step(lagrange_top_solver *s, double h);
lagrange_top_status lagrange_top_integrate(lagrange_top_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on lagrange_top_BAD_ARGUMENT.
   Either may leave the leaf. */
lagrange_top_status lagrange_top_set_state(lagrange_top_solver *s, const double x[lagrange_top_DIM]);
lagrange_top_status lagrange_top_kick(lagrange_top_solver *s, const double change[lagrange_top_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
lagrange_top_status lagrange_top_ensemble(const lagrange_top_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* LAGRANGE_TOP_H */
