/*
 * The declarations of kowalevski_gauss.c. DO NOT EDIT: phigen detects changes by the checksum below.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 414a5ece7bc0314022fe05ff46e84f4bdc59eba92ab677d165118693f9e59f21
 */
#ifndef KOWALEVSKI_GAUSS_H
#define KOWALEVSKI_GAUSS_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define kowalevski_gauss_DIM 6      /* coordinates: P1, P2, P3, G1, G2, G3 */
#define kowalevski_gauss_ORDER 16   /* order of the method */
#define kowalevski_gauss_CASIMIRS 2 /* Casimirs: A, B */
#define kowalevski_gauss_PHIGEN_VERSION "0.1.0"
#define kowalevski_gauss_SPEC_SHA256 "7363dc409595ab651edd1c499770a65a43237d29236ead2b2522363a4cf0bd33"
enum { kowalevski_gauss_COEFFICIENTS = 1 }; /* number of coefficients: functions of params and h */
enum { kowalevski_gauss_NODES = 8 };        /* number of stages of a step */
enum { kowalevski_gauss_WIDTH = 8 };        /* number of entries of an array over the stages */
enum { kowalevski_gauss_UNKNOWNS = 8 };     /* number of unknowns of a stage */
enum { kowalevski_gauss_EARLIER = 2 };      /* number of steps that predictors read */

typedef struct {
    char unused; /* this system has no parameters */
} kowalevski_gauss_params;
extern const kowalevski_gauss_params kowalevski_gauss_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double kowalevski_gauss_hamiltonian(const kowalevski_gauss_params *params, const double x[6]);
void kowalevski_gauss_casimirs(const kowalevski_gauss_params *params, const double x[6], double out[]);
void kowalevski_gauss_vector_field(const kowalevski_gauss_params *params, const double x[6], double out[6]);

typedef enum { kowalevski_gauss_OK = 0, kowalevski_gauss_NO_CONVERGENCE, kowalevski_gauss_SINGULAR,
    kowalevski_gauss_NOT_FINITE, kowalevski_gauss_BAD_ARGUMENT } kowalevski_gauss_status;
const char *kowalevski_gauss_status_string(kowalevski_gauss_status status); /* the meaning of a status */

/* Results of the last steps, from which the starting values of the next iteration are predicted. They affect
   the speed only. Unknowns are offsets from a state, called their frame. A sweep iterates all stages once. */
typedef struct {
    int count;     /* number of steps in the array `increments` */
    int latest;    /* index of the last step in the array `increments` */
    int sweeps;    /* number of the first sweep whose change is measured */
    int predictor; /* index in kowalevski_gauss_prediction of the predictor for the next step */
    /* steps since the predictors were first compared; they are compared again after every
       kowalevski_gauss_TRIALS steps */
    int age;
    double rate; /* factor by which the changes of a sweep shrink from one sweep to the next */
    int kicked;  /* whether the state was changed since the last step */
    double h;    /* size of the last step */
    /* stage increments of the last steps, in the frame at the end of the last step */
    double increments[kowalevski_gauss_EARLIER][kowalevski_gauss_UNKNOWNS][kowalevski_gauss_WIDTH];
} kowalevski_gauss_history;

/* A copy of this struct is an independent solver. Arguments of functions may point into it, or overlap. */
typedef struct {
    double x[kowalevski_gauss_DIM]; /* the state; change it only by the functions below */
    double carry[kowalevski_gauss_DIM]; /* rounding error of x: x + carry is more accurate */
    size_t steps; /* number of successful steps since kowalevski_gauss_init */
    size_t evaluations; /* number of sweeps over the stages, for statistics */
    double t; /* time since kowalevski_gauss_init */
    double h; /* size of the last step; NaN before the first step */
    kowalevski_gauss_params params; /* the parameters, set by kowalevski_gauss_init; do not change them */
    double coef[kowalevski_gauss_COEFFICIENTS]; /* functions of params and h, computed when h changes */
    size_t steps_before_h; /* steps and t at the last change of h: t = t_before_h + (steps since then) h */
    double t_before_h;
    kowalevski_gauss_history history; /* predictor of the starting value of the iteration */
} kowalevski_gauss_solver;
size_t kowalevski_gauss_solver_size(void); /* in bytes, for languages that cannot read the struct */
size_t kowalevski_gauss_solver_steps_done(const kowalevski_gauss_solver *s);

/* Initialise *s with the state x0; params = NULL for the defaults. Returns kowalevski_gauss_BAD_ARGUMENT,
   with *s unchanged, if a value or coefficient is not finite, or a parameter that must be positive is not. */
kowalevski_gauss_status kowalevski_gauss_init(kowalevski_gauss_solver *s,
    const kowalevski_gauss_params *params, const double x0[kowalevski_gauss_DIM]);

/* Make steps of size h, of either sign. If a step fails, s->x and s->steps remain those before this step. */
kowalevski_gauss_status kowalevski_gauss_step(kowalevski_gauss_solver *s, double h);
kowalevski_gauss_status kowalevski_gauss_integrate(kowalevski_gauss_solver *s, double h, size_t steps);

/* Between steps: replace the state by x, or add `change` to the state. The values of Casimirs may change.
   Returns kowalevski_gauss_BAD_ARGUMENT, with *s unchanged, if the new state is not finite. */
kowalevski_gauss_status kowalevski_gauss_set_state(kowalevski_gauss_solver *s,
    const double x[kowalevski_gauss_DIM]);
kowalevski_gauss_status kowalevski_gauss_kick(kowalevski_gauss_solver *s,
    const double change[kowalevski_gauss_DIM]);

/* States at fractions of the last step, 0 at its start and 1 at its end, by the collocation polynomial: x[r *
   kowalevski_gauss_DIM + i] is x_i at fraction[r]. These states serve to find events. They are far less
   accurate than steps, and lie off the symplectic leaf by their error. For a state at an event with the
   accuracy of steps, make a step of size (fraction - 1) h with a copy of *s. Returns
   kowalevski_gauss_BAD_ARGUMENT before the first step, and after a change of the state. */
kowalevski_gauss_status kowalevski_gauss_interpolate(const kowalevski_gauss_solver *s, const double *fraction,
    size_t count, double *x);

/* Integrate members in place: x[i * members + m] is coordinate i of member m. Failed members get their last
   good state. status[m] is for member m; `status` may be NULL. Returns the first status that is not OK. */
kowalevski_gauss_status kowalevski_gauss_ensemble(const kowalevski_gauss_params *params, double *x,
    size_t members, double h, size_t steps, unsigned char *status);

/* As kowalevski_gauss_ensemble, for members with separate parameters params[m] and step sizes h[m]. params
   may be NULL for the defaults. */
/* `frames`, if not NULL, receives the states after every stride-th step: frames[(k * kowalevski_gauss_DIM +
   i) * members + m] is coordinate i of member m after (k + 1) * stride steps, NaN if the member failed
   before. Arrays must not overlap. */
kowalevski_gauss_status kowalevski_gauss_ensemble_each(const kowalevski_gauss_params *params, double *x,
    size_t members, const double *h, size_t steps, size_t stride, double *frames, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* KOWALEVSKI_GAUSS_H */
