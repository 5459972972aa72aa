/*
 * The declarations of quaternion_top.c. DO NOT EDIT: phigen detects changes by the checksum below.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 56fa5b7886680aa44bba6541bd9a9b3b6efbc5ac0c2b4a270e0abca7d36c61ba
 */
#ifndef QUATERNION_TOP_H
#define QUATERNION_TOP_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define quaternion_top_DIM 7      /* coordinates: m1, m2, m3, w, x, y, z */
#define quaternion_top_ORDER 4    /* order of the method */
#define quaternion_top_CASIMIRS 1 /* Casimirs: length */
#define quaternion_top_PHIGEN_VERSION "0.1.0"
#define quaternion_top_SPEC_SHA256 "700546472243a76056288ba748c5fa272452573e41bbf16315339d7dc615c693"
enum { quaternion_top_COEFFICIENTS = 47 }; /* number of coefficients: functions of params and h */
enum { quaternion_top_GAUGES = 1 }; /* number of Casimirs whose multiples are subtracted from H: `length` */
enum { quaternion_top_DIFFERENCES = 9 }; /* entries of the predictor; more would amplify rounding errors */

typedef struct {
    double I1;     /* least moment of inertia */
    double I2;     /* intermediate moment of inertia */
    double I3;     /* largest moment of inertia */
    double weight; /* weight times the distance of the centre of mass from the fixed point */
    double spring; /* stiffness of the torsion spring */
} quaternion_top_params;
extern const quaternion_top_params quaternion_top_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double quaternion_top_hamiltonian(const quaternion_top_params *params, const double x[7]);
void quaternion_top_casimirs(const quaternion_top_params *params, const double x[7], double out[]);
void quaternion_top_vector_field(const quaternion_top_params *params, const double x[7], double out[7]);

typedef enum { quaternion_top_OK = 0, quaternion_top_NO_CONVERGENCE, quaternion_top_SINGULAR,
    quaternion_top_NOT_FINITE, quaternion_top_BAD_ARGUMENT } quaternion_top_status;
const char *quaternion_top_status_string(quaternion_top_status status); /* the meaning of a status */

/* Predictor, which affects the speed only: the last solution and backward differences, for extrapolation. */
typedef struct {
    int count, order; /* number of stored entries, and number of entries whose sum is the prediction */
    /* the last solution, then its differences */
    double difference[quaternion_top_DIFFERENCES][quaternion_top_DIM];
} quaternion_top_history;

/* A copy of this struct is an independent solver. Arguments of functions may point into it, or overlap. */
typedef struct {
    double x[quaternion_top_DIM]; /* the state; change it only by the functions below */
    double carry[quaternion_top_DIM]; /* rounding error of x: x + carry is more accurate */
    size_t steps; /* number of successful steps since quaternion_top_init */
    size_t evaluations; /* number of evaluations of the generating function, for statistics */
    double t; /* time since quaternion_top_init */
    double h; /* size of the last step; NaN before the first step */
    quaternion_top_params params; /* the parameters, set by quaternion_top_init; do not change them */
    double gauge[quaternion_top_GAUGES]; /* gauge[k] times Casimir k is subtracted from H */
    double coef[quaternion_top_COEFFICIENTS]; /* functions of params and h, computed when h changes */
    size_t steps_before_h; /* steps and t at the last change of h: t = t_before_h + (steps since then) h */
    double t_before_h;
    quaternion_top_history history; /* predictor of the starting value of the iteration */
} quaternion_top_solver;
size_t quaternion_top_solver_size(void); /* in bytes, for languages that cannot read the struct */
size_t quaternion_top_solver_steps_done(const quaternion_top_solver *s);

/* Initialise *s with the state x0; params = NULL for the defaults. Returns quaternion_top_BAD_ARGUMENT, with
   *s unchanged, if a value or coefficient is not finite, or a parameter that must be positive is not. */
quaternion_top_status quaternion_top_init(quaternion_top_solver *s, const quaternion_top_params *params,
    const double x0[quaternion_top_DIM]);

/* As quaternion_top_init, with a given gauge: steps subtract gauge[k] times Casimir k from H. */
quaternion_top_status quaternion_top_init_gauge(quaternion_top_solver *s, const quaternion_top_params *params,
    const double x0[quaternion_top_DIM], const double gauge[quaternion_top_GAUGES]);

/* Make steps of size h, of either sign. If a step fails, s->x and s->steps remain those before this step. */
quaternion_top_status quaternion_top_step(quaternion_top_solver *s, double h);
quaternion_top_status quaternion_top_integrate(quaternion_top_solver *s, double h, size_t steps);

/* Between steps: replace the state by x, or add `change` to the state. The values of Casimirs may change.
   Returns quaternion_top_BAD_ARGUMENT, with *s unchanged, if the new state is not finite. */
quaternion_top_status quaternion_top_set_state(quaternion_top_solver *s, const double x[quaternion_top_DIM]);
quaternion_top_status quaternion_top_kick(quaternion_top_solver *s, const double change[quaternion_top_DIM]);

/* Integrate members in place: x[i * members + m] is coordinate i of member m. Failed members get their last
   good state. status[m] is for member m; `status` may be NULL. Returns the first status that is not OK. */
quaternion_top_status quaternion_top_ensemble(const quaternion_top_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* QUATERNION_TOP_H */
