/*
 * The declarations of sklyanin_gyrostat.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 238776b0d16ea938f765b0b957a18557a1aabe15c4c724a4ae844007b516f5b8
 */
#ifndef SKLYANIN_GYROSTAT_H
#define SKLYANIN_GYROSTAT_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define sklyanin_gyrostat_DIM 4 /* coordinates: S0, S1, S2, S3 */
#define sklyanin_gyrostat_ORDER 4
#define sklyanin_gyrostat_CASIMIRS 2 /* K0, K1 */
#define sklyanin_gyrostat_PHIGEN_VERSION "0.1.0"
#define sklyanin_gyrostat_SPEC_SHA256 "e651a28cdc56907d5b5af694cc55378ac05a29592265e45944f163a14d4ec86f"
enum { sklyanin_gyrostat_COEFFICIENTS = 31 }; /* numbers that depend on params and h only */
enum { sklyanin_gyrostat_GAUGES = 1 };        /* Casimirs whose multiples are taken from H: K0 */

typedef struct {
    char unused; /* this system has no parameters */
} sklyanin_gyrostat_params;
extern const sklyanin_gyrostat_params sklyanin_gyrostat_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double sklyanin_gyrostat_hamiltonian(const sklyanin_gyrostat_params *params, const double x[4]);
void sklyanin_gyrostat_casimirs(const sklyanin_gyrostat_params *params, const double x[4], double out[]);
void sklyanin_gyrostat_vector_field(const sklyanin_gyrostat_params *params, const double x[4], double out[4]);

typedef enum { sklyanin_gyrostat_OK = 0, sklyanin_gyrostat_NO_CONVERGENCE, sklyanin_gyrostat_SINGULAR,
    sklyanin_gyrostat_NOT_FINITE, sklyanin_gyrostat_BAD_ARGUMENT } sklyanin_gyrostat_status;
const char *sklyanin_gyrostat_status_string(sklyanin_gyrostat_status status);

enum { sklyanin_gyrostat_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[sklyanin_gyrostat_DIFFERENCES][sklyanin_gyrostat_DIM];
} sklyanin_gyrostat_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[sklyanin_gyrostat_DIM];     /* the state; read it freely, change it only through functions */
    double carry[sklyanin_gyrostat_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                        /* good steps since sklyanin_gyrostat_init */
    size_t evaluations;                  /* of the generating function, for statistics */
    double t;                            /* time since sklyanin_gyrostat_init */
    double h;                            /* the last step size; NaN before the first step */
    sklyanin_gyrostat_params params;
    double gauge[sklyanin_gyrostat_GAUGES]; /* multiples of Casimirs that are taken from H, in their order */
    double coef[sklyanin_gyrostat_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    sklyanin_gyrostat_history history; /* for starting guesses */
} sklyanin_gyrostat_solver;
size_t sklyanin_gyrostat_solver_size(void); /* for bindings to other languages, as what follows */
size_t sklyanin_gyrostat_solver_steps_done(const sklyanin_gyrostat_solver *s);

/* Start at x0. params may be NULL for the defaults. sklyanin_gyrostat_BAD_ARGUMENT, and *s as before, if x0,
   a parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
sklyanin_gyrostat_status sklyanin_gyrostat_init(sklyanin_gyrostat_solver *s,
    const sklyanin_gyrostat_params *params, const double x0[sklyanin_gyrostat_DIM]);

/* Start at x0 with a gauge of one's own: the step is an exact Poisson map for each fixed gauge. */
sklyanin_gyrostat_status sklyanin_gyrostat_init_gauge(sklyanin_gyrostat_solver *s,
    const sklyanin_gyrostat_params *params, const double x0[sklyanin_gyrostat_DIM],
    const double gauge[sklyanin_gyrostat_GAUGES]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
sklyanin_gyrostat_status sklyanin_gyrostat_step(sklyanin_gyrostat_solver *s, double h);
sklyanin_gyrostat_status sklyanin_gyrostat_integrate(sklyanin_gyrostat_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   sklyanin_gyrostat_BAD_ARGUMENT. Either may leave the leaf. */
sklyanin_gyrostat_status sklyanin_gyrostat_set_state(sklyanin_gyrostat_solver *s,
    const double x[sklyanin_gyrostat_DIM]);
sklyanin_gyrostat_status sklyanin_gyrostat_kick(sklyanin_gyrostat_solver *s,
    const double change[sklyanin_gyrostat_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
sklyanin_gyrostat_status sklyanin_gyrostat_ensemble(const sklyanin_gyrostat_params *params, double *x,
    size_t members, double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* SKLYANIN_GYROSTAT_H */
