/*
 * The declarations of dzhanibekov.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: da64b0afd6baefb746c34f8452e76d0a26ae3140e865874ff58d5098dddf1f8e
 */
#ifndef DZHANIBEKOV_H
#define DZHANIBEKOV_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define dzhanibekov_DIM 3 /* coordinates: x1, x2, x3 */
#define dzhanibekov_ORDER 6
#define dzhanibekov_CASIMIRS 1 /* C */
#define dzhanibekov_PHIGEN_VERSION "0.1.0"
#define dzhanibekov_SPEC_SHA256 "69c6aa7f443565487e48a933405a1745ed7142d940611d93ee67a5351a59ea66"
enum { dzhanibekov_COEFFICIENTS = 35 }; /* numbers that depend on params and h only */
enum { dzhanibekov_GAUGES = 1 };        /* Casimirs whose multiples are taken from H: C */
enum { dzhanibekov_ATTITUDE_SIZE = 4 }; /* numbers of an attitude, a quaternion */
enum { dzhanibekov_ELEMENT = 4 };       /* numbers of an element of the group */
enum { dzhanibekov_RATE = 3 };          /* numbers of what the Casimirs turn */

typedef struct {
    double I1; /* least moment of inertia */
    double I2; /* intermediate moment of inertia */
    double I3; /* largest moment of inertia */
} dzhanibekov_params;
extern const dzhanibekov_params dzhanibekov_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double dzhanibekov_hamiltonian(const dzhanibekov_params *params, const double x[3]);
void dzhanibekov_casimirs(const dzhanibekov_params *params, const double x[3], double out[]);
void dzhanibekov_vector_field(const dzhanibekov_params *params, const double x[3], double out[3]);

typedef enum { dzhanibekov_OK = 0, dzhanibekov_NO_CONVERGENCE, dzhanibekov_SINGULAR, dzhanibekov_NOT_FINITE,
    dzhanibekov_BAD_ARGUMENT } dzhanibekov_status;
const char *dzhanibekov_status_string(dzhanibekov_status status);

enum { dzhanibekov_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[dzhanibekov_DIFFERENCES][dzhanibekov_DIM];
} dzhanibekov_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[dzhanibekov_DIM];     /* the state; read it freely, change it only through functions */
    double carry[dzhanibekov_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                  /* good steps since dzhanibekov_init */
    size_t evaluations;            /* of the generating function, for statistics */
    double t;                      /* time since dzhanibekov_init */
    double h;                      /* the last step size; NaN before the first step */
    dzhanibekov_params params;
    double gauge[dzhanibekov_GAUGES];      /* multiples of Casimirs that are taken from H, in their order */
    double coef[dzhanibekov_COEFFICIENTS]; /* all that depends on params and h only */
    /* the quaternion (w, x, y, z) that turns body into space; see dzhanibekov_set_attitude */
    double attitude[dzhanibekov_ATTITUDE_SIZE];
    /* the product of what steps turned by; what rounding took */
    double turned[dzhanibekov_ELEMENT], turned_carry[dzhanibekov_ELEMENT];
    /* the gradient of the Casimirs that are taken from H: the body turns by them too */
    double rate[dzhanibekov_RATE];
    double aside[dzhanibekov_ELEMENT]; /* what it turns by so in a step, less 1 */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    dzhanibekov_history history; /* for starting guesses */
} dzhanibekov_solver;
size_t dzhanibekov_solver_size(void); /* for bindings to other languages, as what follows */
size_t dzhanibekov_solver_steps_done(const dzhanibekov_solver *s);
void dzhanibekov_attitude(const dzhanibekov_solver *s, double out[dzhanibekov_ELEMENT]);

/* Start at x0. params may be NULL for the defaults. dzhanibekov_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
dzhanibekov_status dzhanibekov_init(dzhanibekov_solver *s, const dzhanibekov_params *params,
    const double x0[dzhanibekov_DIM]);

/* The attitude, from now on. dzhanibekov_init begins with the identity. */
/* Of any length but 0. dzhanibekov_BAD_ARGUMENT where it is not finite, or 0. */
dzhanibekov_status dzhanibekov_set_attitude(dzhanibekov_solver *s,
    const double attitude[dzhanibekov_ATTITUDE_SIZE]);

/* Start at x0 with a gauge of one's own: the step is an exact Poisson map for each fixed gauge. */
dzhanibekov_status dzhanibekov_init_gauge(dzhanibekov_solver *s, const dzhanibekov_params *params,
    const double x0[dzhanibekov_DIM], const double gauge[dzhanibekov_GAUGES]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
dzhanibekov_status dzhanibekov_step(dzhanibekov_solver *s, double h);
dzhanibekov_status dzhanibekov_integrate(dzhanibekov_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on dzhanibekov_BAD_ARGUMENT.
   Either may leave the leaf. */
dzhanibekov_status dzhanibekov_set_state(dzhanibekov_solver *s, const double x[dzhanibekov_DIM]);
dzhanibekov_status dzhanibekov_kick(dzhanibekov_solver *s, const double change[dzhanibekov_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
dzhanibekov_status dzhanibekov_ensemble(const dzhanibekov_params *params, double *x, size_t members, double h,
    size_t steps, unsigned char *status);

/* Many members with attitudes, in place, each by itself as dzhanibekov_integrate makes it; with OpenMP,
   members in parallel: x[i * members + m] is coordinate i of member m, attitude[i * members + m] number i of
   its attitude in the order of dzhanibekov_attitude, at its start, then at its end. What differs from member
   to member is given as for a single one, params may be NULL for the defaults. frames and attitudes (or NULL)
   receive what x and attitude are after every stride-th step, those after (k + 1) * stride steps as row k,
   NaN where a member failed before. Arrays must not overlap. */
dzhanibekov_status dzhanibekov_ensemble_attitudes(const dzhanibekov_params *params, double *x,
    double *attitude, size_t members, const double *gauge, const double *h, size_t steps, size_t stride,
    double *frames, double *attitudes, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* DZHANIBEKOV_H */
