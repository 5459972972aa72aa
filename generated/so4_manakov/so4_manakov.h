/*
 * The declarations of so4_manakov.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: e267d73b8b65192d68ddc179b44b1f74a9839d6d21952f6d7762c2eb749081a4
 */
#ifndef SO4_MANAKOV_H
#define SO4_MANAKOV_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define so4_manakov_DIM 6 /* coordinates: x12, x13, x14, x23, x24, x34 */
#define so4_manakov_ORDER 4
#define so4_manakov_CASIMIRS 2 /* A, B */
#define so4_manakov_PHIGEN_VERSION "0.1.0"
#define so4_manakov_SPEC_SHA256 "c60c8cfe639c4453a54f9110f2a3b99c614520fc0699d00cf0c68db1b9948be4"
enum { so4_manakov_COEFFICIENTS = 32 }; /* numbers that depend on params and h only */
enum { so4_manakov_GAUGES = 1 };        /* Casimirs whose multiples are taken from H: A */

typedef struct {
    char unused; /* this system has no parameters */
} so4_manakov_params;
extern const so4_manakov_params so4_manakov_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double so4_manakov_hamiltonian(const so4_manakov_params *params, const double x[6]);
void so4_manakov_casimirs(const so4_manakov_params *params, const double x[6], double out[]);
void so4_manakov_vector_field(const so4_manakov_params *params, const double x[6], double out[6]);

typedef enum { so4_manakov_OK = 0, so4_manakov_NO_CONVERGENCE, so4_manakov_SINGULAR, so4_manakov_NOT_FINITE,
    so4_manakov_BAD_ARGUMENT } so4_manakov_status;
const char *so4_manakov_status_string(so4_manakov_status status);

enum { so4_manakov_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[so4_manakov_DIFFERENCES][so4_manakov_DIM];
} so4_manakov_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[so4_manakov_DIM];     /* the state; read it freely, change it only through functions */
    double carry[so4_manakov_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                  /* good steps since so4_manakov_init */
    size_t evaluations;            /* of the generating function, for statistics */
    double t;                      /* time since so4_manakov_init */
    double h;                      /* the last step size; NaN before the first step */
    so4_manakov_params params;
    double gauge[so4_manakov_GAUGES]; /* multiples of Casimirs that are taken from H, in their order */
    double coef[so4_manakov_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    so4_manakov_history history; /* for starting guesses */
} so4_manakov_solver;
size_t so4_manakov_solver_size(void); /* for bindings to other languages, as what follows */
size_t so4_manakov_solver_steps_done(const so4_manakov_solver *s);

/* Start at x0. params may be NULL for the defaults. so4_manakov_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
so4_manakov_status so4_manakov_init(so4_manakov_solver *s, const so4_manakov_params *params,
    const double x0[so4_manakov_DIM]);

/* Start at x0 with a gauge of one's own: the step is an exact Poisson map for each fixed gauge. */
so4_manakov_status so4_manakov_init_gauge(so4_manakov_solver *s, const so4_manakov_params *params,
    const double x0[so4_manakov_DIM], const double gauge[so4_manakov_GAUGES]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
so4_manakov_status so4_manakov_step(so4_manakov_solver *s, double h);
so4_manakov_status so4_manakov_integrate(so4_manakov_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on so4_manakov_BAD_ARGUMENT.
   Either may leave the leaf. */
so4_manakov_status so4_manakov_set_state(so4_manakov_solver *s, const double x[so4_manakov_DIM]);
so4_manakov_status so4_manakov_kick(so4_manakov_solver *s, const double change[so4_manakov_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
so4_manakov_status so4_manakov_ensemble(const so4_manakov_params *params, double *x, size_t members, double h,
    size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* SO4_MANAKOV_H */
