/*
 * The declarations of satellite.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 515f9169c5defd57a2b56162f0b1c3e9f5961c89d5979a319a04100505ff24d2
 */
#ifndef SATELLITE_H
#define SATELLITE_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define satellite_DIM 9 /* coordinates: m1, m2, m3, N1, N2, N3, G1, G2, G3 */
#define satellite_ORDER 4
#define satellite_CASIMIRS 3 /* N, G, A */
#define satellite_PHIGEN_VERSION "0.1.0"
#define satellite_SPEC_SHA256 "dc272fb52ae5f34a922056236d9e6fdb08ff8338f24456d0b55a9a52485fca76"
enum { satellite_STAGES = 5 };        /* of a step */
enum { satellite_COEFFICIENTS = 7 };  /* numbers that depend on params and h only */
enum { satellite_ATTITUDE_SIZE = 4 }; /* numbers of an attitude, a quaternion */
enum { satellite_ELEMENT = 4 };       /* numbers of an element of the group */

typedef struct {
    double I1; /* least moment of inertia */
    double I2; /* intermediate moment of inertia */
    double I3; /* largest moment of inertia */
    double n;  /* mean motion of the orbit */
} satellite_params;
extern const satellite_params satellite_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double satellite_hamiltonian(const satellite_params *params, const double x[9]);
void satellite_casimirs(const satellite_params *params, const double x[9], double out[]);
void satellite_vector_field(const satellite_params *params, const double x[9], double out[9]);

typedef enum { satellite_OK = 0, satellite_NO_CONVERGENCE, satellite_SINGULAR, satellite_NOT_FINITE,
    satellite_BAD_ARGUMENT } satellite_status;
const char *satellite_status_string(satellite_status status);

enum { satellite_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[satellite_DIFFERENCES][satellite_DIM];
} satellite_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[satellite_DIM];     /* the state; read it freely, change it only through functions */
    double carry[satellite_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                /* good steps since satellite_init */
    size_t evaluations;          /* of the generating function, for statistics */
    double t;                    /* time since satellite_init */
    double h;                    /* the last step size; NaN before the first step */
    satellite_params params;
    double coef[satellite_STAGES][satellite_COEFFICIENTS]; /* all that depends on params and h only */
    /* the quaternion (w, x, y, z) that turns body into space; see satellite_set_attitude */
    double attitude[satellite_ATTITUDE_SIZE];
    /* the product of what steps turned by; what rounding took */
    double turned[satellite_ELEMENT], turned_carry[satellite_ELEMENT];
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    satellite_history history[satellite_STAGES]; /* for starting guesses */
} satellite_solver;
size_t satellite_solver_size(void); /* for bindings to other languages, as what follows */
size_t satellite_solver_steps_done(const satellite_solver *s);
void satellite_attitude(const satellite_solver *s, double out[satellite_ELEMENT]);

/* Start at x0. params may be NULL for the defaults. satellite_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
satellite_status satellite_init(satellite_solver *s, const satellite_params *params,
    const double x0[satellite_DIM]);

/* The attitude, from now on. satellite_init begins with the identity. */
/* Of any length but 0. satellite_BAD_ARGUMENT where it is not finite, or 0. */
satellite_status satellite_set_attitude(satellite_solver *s, const double attitude[satellite_ATTITUDE_SIZE]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
satellite_status satellite_step(satellite_solver *s, double h);
satellite_status satellite_integrate(satellite_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on satellite_BAD_ARGUMENT.
   Either may leave the leaf. */
satellite_status satellite_set_state(satellite_solver *s, const double x[satellite_DIM]);
satellite_status satellite_kick(satellite_solver *s, const double change[satellite_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
satellite_status satellite_ensemble(const satellite_params *params, double *x, size_t members, double h,
    size_t steps, unsigned char *status);

/* Many members with attitudes, in place, each by itself as satellite_integrate makes it; with OpenMP, members
   in parallel: x[i * members + m] is coordinate i of member m, attitude[i * members + m] number i of its
   attitude in the order of satellite_attitude, at its start, then at its end. What differs from member to
   member is given as for a single one, params may be NULL for the defaults. frames and attitudes (or NULL)
   receive what x and attitude are after every stride-th step, those after (k + 1) * stride steps as row k,
   NaN where a member failed before. Arrays must not overlap. */
satellite_status satellite_ensemble_attitudes(const satellite_params *params, double *x, double *attitude,
    size_t members, const double *h, size_t steps, size_t stride, double *frames, double *attitudes,
    unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* SATELLITE_H */
