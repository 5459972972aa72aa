/*
 * The declarations of spin_resonance.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: a778e5865ab3907f00be7ba5426a292ec9206ec21ce02d4d3a8177e0079b650c
 */
#ifndef SPIN_RESONANCE_H
#define SPIN_RESONANCE_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define spin_resonance_DIM 3 /* coordinates: m1, m2, m3 */
#define spin_resonance_ORDER 4
#define spin_resonance_CASIMIRS 1 /* size */
#define spin_resonance_PHIGEN_VERSION "0.1.0"
#define spin_resonance_SPEC_SHA256 "5ddcd1cafa805e373cf495543a70a36ab54b37b0b9b46774ed678f920e677a3b"
enum { spin_resonance_COEFFICIENTS = 15 }; /* numbers that depend on params and h, and on the time */

typedef struct {
    double b0;    /* steady field */
    double b;     /* rotating field */
    double omega; /* its frequency */
    double D;     /* anisotropy: an easy plane if it is positive */
} spin_resonance_params;
extern const spin_resonance_params spin_resonance_default_params;

/* The Hamiltonian at the time t; the Casimirs; the right-hand side pi(x) grad H(t, x). params may be NULL. */
double spin_resonance_hamiltonian(const spin_resonance_params *params, double t, const double x[3]);
void spin_resonance_casimirs(const spin_resonance_params *params, const double x[3], double out[]);
void spin_resonance_vector_field(const spin_resonance_params *params, double t, const double x[3],
    double out[3]);

typedef enum { spin_resonance_OK = 0, spin_resonance_NO_CONVERGENCE, spin_resonance_SINGULAR,
    spin_resonance_NOT_FINITE, spin_resonance_BAD_ARGUMENT } spin_resonance_status;
const char *spin_resonance_status_string(spin_resonance_status status);

enum { spin_resonance_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[spin_resonance_DIFFERENCES][spin_resonance_DIM];
} spin_resonance_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[spin_resonance_DIM];     /* the state; read it freely, change it only through functions */
    double carry[spin_resonance_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                     /* good steps since spin_resonance_init */
    size_t evaluations;               /* of the generating function, for statistics */
    double t;                         /* the time of x */
    double h;                         /* the last step size; NaN before the first step */
    spin_resonance_params params;
    /* what depends on params and h only, then on the time of the step as well */
    double coef[spin_resonance_COEFFICIENTS];
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    spin_resonance_history history; /* for starting guesses */
} spin_resonance_solver;
size_t spin_resonance_solver_size(void); /* for bindings to other languages, as what follows */
size_t spin_resonance_solver_steps_done(const spin_resonance_solver *s);

/* Start at x0. params may be NULL for the defaults. spin_resonance_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
spin_resonance_status spin_resonance_init(spin_resonance_solver *s, const spin_resonance_params *params,
    const double x0[spin_resonance_DIM]);

/* The same at the time t0, which spin_resonance_init takes to be 0. */
spin_resonance_status spin_resonance_init_at(spin_resonance_solver *s, const spin_resonance_params *params,
    const double x0[spin_resonance_DIM], double t0);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
spin_resonance_status spin_resonance_step(spin_resonance_solver *s, double h);
spin_resonance_status spin_resonance_integrate(spin_resonance_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   spin_resonance_BAD_ARGUMENT. Either may leave the leaf. */
spin_resonance_status spin_resonance_set_state(spin_resonance_solver *s, const double x[spin_resonance_DIM]);
spin_resonance_status spin_resonance_kick(spin_resonance_solver *s, const double change[spin_resonance_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
spin_resonance_status spin_resonance_ensemble(const spin_resonance_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

/* The same from the time t0 of all members on, which spin_resonance_ensemble takes to be 0. */
spin_resonance_status spin_resonance_ensemble_at(const spin_resonance_params *params, double *x,
    size_t members, double t0, double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* SPIN_RESONANCE_H */
