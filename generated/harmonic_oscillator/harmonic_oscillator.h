/*
 * The declarations of harmonic_oscillator.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: ccf32c42f34cd7a2093cf7211de24714eabcc9badba75aa5c4c63b0a9bf48981
 */
#ifndef HARMONIC_OSCILLATOR_H
#define HARMONIC_OSCILLATOR_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define harmonic_oscillator_DIM 2 /* coordinates: q, p */
#define harmonic_oscillator_ORDER 4
#define harmonic_oscillator_CASIMIRS 0
#define harmonic_oscillator_PHIGEN_VERSION "0.1.0"
#define harmonic_oscillator_SPEC_SHA256 "8fea2d54be1733fb7959bf089f29b69f069d88cc4d415a7096ee372bcd8b8f90"
enum { harmonic_oscillator_COEFFICIENTS = 5 }; /* numbers that depend on params and h only */

typedef struct {
    double m; /* mass */
    double k; /* stiffness of the spring */
} harmonic_oscillator_params;
extern const harmonic_oscillator_params harmonic_oscillator_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double harmonic_oscillator_hamiltonian(const harmonic_oscillator_params *params, const double x[2]);
void harmonic_oscillator_casimirs(const harmonic_oscillator_params *params, const double x[2], double out[]);
void harmonic_oscillator_vector_field(const harmonic_oscillator_params *params, const double x[2],
    double out[2]);

typedef enum { harmonic_oscillator_OK = 0, harmonic_oscillator_NO_CONVERGENCE, harmonic_oscillator_SINGULAR,
    harmonic_oscillator_NOT_FINITE, harmonic_oscillator_BAD_ARGUMENT } harmonic_oscillator_status;
const char *harmonic_oscillator_status_string(harmonic_oscillator_status status);

enum { harmonic_oscillator_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[harmonic_oscillator_DIFFERENCES][harmonic_oscillator_DIM];
} harmonic_oscillator_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[harmonic_oscillator_DIM];     /* the state; read it freely, change it only through functions */
    double carry[harmonic_oscillator_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                          /* good steps since harmonic_oscillator_init */
    size_t evaluations;                    /* of the generating function, for statistics */
    double t;                              /* time since harmonic_oscillator_init */
    double h;                              /* the last step size; NaN before the first step */
    harmonic_oscillator_params params;
    double coef[harmonic_oscillator_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    harmonic_oscillator_history history; /* for starting guesses */
} harmonic_oscillator_solver;
size_t harmonic_oscillator_solver_size(void); /* for bindings to other languages, as what follows */
size_t harmonic_oscillator_solver_steps_done(const harmonic_oscillator_solver *s);

/* Start at x0. params may be NULL for the defaults. harmonic_oscillator_BAD_ARGUMENT, and *s as before, if
   x0, a parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
harmonic_oscillator_status harmonic_oscillator_init(harmonic_oscillator_solver *s,
    const harmonic_oscillator_params *params, const double x0[harmonic_oscillator_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
harmonic_oscillator_status harmonic_oscillator_step(harmonic_oscillator_solver *s, double h);
harmonic_oscillator_status harmonic_oscillator_integrate(harmonic_oscillator_solver *s, double h,
    size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   harmonic_oscillator_BAD_ARGUMENT. Either may leave the leaf. */
harmonic_oscillator_status harmonic_oscillator_set_state(harmonic_oscillator_solver *s,
    const double x[harmonic_oscillator_DIM]);
harmonic_oscillator_status harmonic_oscillator_kick(harmonic_oscillator_solver *s,
    const double change[harmonic_oscillator_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
harmonic_oscillator_status harmonic_oscillator_ensemble(const harmonic_oscillator_params *params, double *x,
    size_t members, double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* HARMONIC_OSCILLATOR_H */
