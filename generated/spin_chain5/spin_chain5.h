/*
 * The declarations of spin_chain5.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 75083b58cb812fd8c23d056dd8d4acf049b38403df23caa45ff4347c0f80200b
 */
#ifndef SPIN_CHAIN5_H
#define SPIN_CHAIN5_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define spin_chain5_DIM 15 /* coordinates: x1, y1, z1, x2, y2, z2, x3, y3, z3, x4, y4, z4, x5, y5, z5 */
#define spin_chain5_ORDER 4
#define spin_chain5_CASIMIRS 5 /* C1, C2, C3, C4, C5 */
#define spin_chain5_PHIGEN_VERSION "0.1.0"
#define spin_chain5_SPEC_SHA256 "822f770e232b566fca45eb393c188aab67b907df200761f36001661c9c3fe5e9"
enum { spin_chain5_COEFFICIENTS = 33 }; /* numbers that depend on params and h only */
enum { spin_chain5_GAUGES = 5 };        /* Casimirs whose multiples are taken from H: C1, C2, C3, C4, C5 */

typedef struct {
    double J; /* exchange constant, ferromagnetic if positive */
} spin_chain5_params;
extern const spin_chain5_params spin_chain5_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double spin_chain5_hamiltonian(const spin_chain5_params *params, const double x[15]);
void spin_chain5_casimirs(const spin_chain5_params *params, const double x[15], double out[]);
void spin_chain5_vector_field(const spin_chain5_params *params, const double x[15], double out[15]);

typedef enum { spin_chain5_OK = 0, spin_chain5_NO_CONVERGENCE, spin_chain5_SINGULAR, spin_chain5_NOT_FINITE,
    spin_chain5_BAD_ARGUMENT } spin_chain5_status;
const char *spin_chain5_status_string(spin_chain5_status status);

enum { spin_chain5_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[spin_chain5_DIFFERENCES][spin_chain5_DIM];
} spin_chain5_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[spin_chain5_DIM];     /* the state; read it freely, change it only through functions */
    double carry[spin_chain5_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                  /* good steps since spin_chain5_init */
    size_t evaluations;            /* of the generating function, for statistics */
    double t;                      /* time since spin_chain5_init */
    double h;                      /* the last step size; NaN before the first step */
    spin_chain5_params params;
    double gauge[spin_chain5_GAUGES]; /* multiples of Casimirs that are taken from H, in their order */
    double coef[spin_chain5_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    spin_chain5_history history; /* for starting guesses */
} spin_chain5_solver;
size_t spin_chain5_solver_size(void); /* for bindings to other languages, as what follows */
size_t spin_chain5_solver_steps_done(const spin_chain5_solver *s);

/* Start at x0. params may be NULL for the defaults. spin_chain5_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
spin_chain5_status spin_chain5_init(spin_chain5_solver *s, const spin_chain5_params *params,
    const double x0[spin_chain5_DIM]);

/* Start at x0 with a gauge of one's own: the step is an exact Poisson map for each fixed gauge. */
spin_chain5_status spin_chain5_init_gauge(spin_chain5_solver *s, const spin_chain5_params *params,
    const double x0[spin_chain5_DIM], const double gauge[spin_chain5_GAUGES]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
spin_chain5_status spin_chain5_step(spin_chain5_solver *s, double h);
spin_chain5_status spin_chain5_integrate(spin_chain5_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on spin_chain5_BAD_ARGUMENT.
   Either may leave the leaf. */
spin_chain5_status spin_chain5_set_state(spin_chain5_solver *s, const double x[spin_chain5_DIM]);
spin_chain5_status spin_chain5_kick(spin_chain5_solver *s, const double change[spin_chain5_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
spin_chain5_status spin_chain5_ensemble(const spin_chain5_params *params, double *x, size_t members, double h,
    size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* SPIN_CHAIN5_H */
