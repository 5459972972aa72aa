/*
 * The declarations of quaternion_top.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 1d47979182b05ab2fe133576fa521998fcb1345917ae1e9bb8b7250e1c580ee6
 */
#ifndef QUATERNION_TOP_H
#define QUATERNION_TOP_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define quaternion_top_DIM 7 /* coordinates: m1, m2, m3, w, x, y, z */
#define quaternion_top_ORDER 4
#define quaternion_top_CASIMIRS 1 /* length */
#define quaternion_top_PHIGEN_VERSION "0.1.0"
#define quaternion_top_SPEC_SHA256 "818ae683b38dea8c70860ad173c7962b5eb71229e0d7aeaea854acb32ebba04c"
enum { quaternion_top_COEFFICIENTS = 47 }; /* numbers that depend on params and h only */
enum { quaternion_top_GAUGES = 1 };        /* Casimirs whose multiples are taken from H: length */
enum { quaternion_top_DIFFERENCES = 9 };   /* that a step is extrapolated from: more amplify rounding */

typedef struct {
    double I1;     /* least moment of inertia */
    double I2;     /* intermediate moment of inertia */
    double I3;     /* largest moment of inertia */
    double weight; /* weight times the distance of the centre of mass from the fixed point */
    double spring; /* stiffness of the spring that wants w = 1 or w = -1 */
} quaternion_top_params;
extern const quaternion_top_params quaternion_top_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double quaternion_top_hamiltonian(const quaternion_top_params *params, const double x[7]);
void quaternion_top_casimirs(const quaternion_top_params *params, const double x[7], double out[]);
void quaternion_top_vector_field(const quaternion_top_params *params, const double x[7], double out[7]);

typedef enum { quaternion_top_OK = 0, quaternion_top_NO_CONVERGENCE, quaternion_top_SINGULAR,
    quaternion_top_NOT_FINITE, quaternion_top_BAD_ARGUMENT } quaternion_top_status;
const char *quaternion_top_status_string(quaternion_top_status status);

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[quaternion_top_DIFFERENCES][quaternion_top_DIM];
} quaternion_top_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[quaternion_top_DIM];     /* the state; read it freely, change it only through functions */
    double carry[quaternion_top_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                     /* good steps since quaternion_top_init */
    size_t evaluations;               /* of the generating function, for statistics */
    double t;                         /* time since quaternion_top_init */
    double h;                         /* the last step size; NaN before the first step */
    quaternion_top_params params;
    double gauge[quaternion_top_GAUGES]; /* multiples of Casimirs that are taken from H, in their order */
    double coef[quaternion_top_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    quaternion_top_history history; /* for starting guesses */
} quaternion_top_solver;
size_t quaternion_top_solver_size(void); /* for bindings to other languages, as what follows */
size_t quaternion_top_solver_steps_done(const quaternion_top_solver *s);

/* Start at x0. params may be NULL for the defaults. quaternion_top_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
quaternion_top_status quaternion_top_init(quaternion_top_solver *s, const quaternion_top_params *params,
    const double x0[quaternion_top_DIM]);

/* Start at x0 with a gauge of one's own: the step is an exact Poisson map for each fixed gauge. */
quaternion_top_status quaternion_top_init_gauge(quaternion_top_solver *s, const quaternion_top_params *params,
    const double x0[quaternion_top_DIM], const double gauge[quaternion_top_GAUGES]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
quaternion_top_status quaternion_top_step(quaternion_top_solver *s, double h);
quaternion_top_status quaternion_top_integrate(quaternion_top_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   quaternion_top_BAD_ARGUMENT. Either may leave the leaf. */
quaternion_top_status quaternion_top_set_state(quaternion_top_solver *s, const double x[quaternion_top_DIM]);
quaternion_top_status quaternion_top_kick(quaternion_top_solver *s, const double change[quaternion_top_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
quaternion_top_status quaternion_top_ensemble(const quaternion_top_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* QUATERNION_TOP_H */
