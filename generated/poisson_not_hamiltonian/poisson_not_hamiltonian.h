/*
 * The declarations of poisson_not_hamiltonian.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: ba2c5dfd6ce45a5c17ba12185edde5fdaecdad4e0ee34d9113631d0f6c9ae5ee
 */
#ifndef POISSON_NOT_HAMILTONIAN_H
#define POISSON_NOT_HAMILTONIAN_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define poisson_not_hamiltonian_DIM 3 /* coordinates: x, y, z */
#define poisson_not_hamiltonian_ORDER 4
#define poisson_not_hamiltonian_CASIMIRS 1 /* C */
#define poisson_not_hamiltonian_PHIGEN_VERSION "0.1.0"
#define poisson_not_hamiltonian_SPEC_SHA256 "91f506e06f622dbaf4083fe4274a994509dabe6e59da3a17c4a06cd9bcaa9603"
enum { poisson_not_hamiltonian_COEFFICIENTS = 2 }; /* numbers that depend on params and h only */

typedef struct {
    char unused; /* this system has no parameters */
} poisson_not_hamiltonian_params;
extern const poisson_not_hamiltonian_params poisson_not_hamiltonian_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double poisson_not_hamiltonian_hamiltonian(const poisson_not_hamiltonian_params *params, const double x[3]);
void poisson_not_hamiltonian_casimirs(const poisson_not_hamiltonian_params *params, const double x[3],
    double out[]);
void poisson_not_hamiltonian_vector_field(const poisson_not_hamiltonian_params *params, const double x[3],
    double out[3]);

typedef enum { poisson_not_hamiltonian_OK = 0, poisson_not_hamiltonian_NO_CONVERGENCE,
    poisson_not_hamiltonian_SINGULAR, poisson_not_hamiltonian_NOT_FINITE,
    poisson_not_hamiltonian_BAD_ARGUMENT } poisson_not_hamiltonian_status;
const char *poisson_not_hamiltonian_status_string(poisson_not_hamiltonian_status status);

/* those of higher order amplify rounding more than they gain */
enum { poisson_not_hamiltonian_DIFFERENCES = 9 };

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[poisson_not_hamiltonian_DIFFERENCES][poisson_not_hamiltonian_DIM];
} poisson_not_hamiltonian_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    /* the state; read it freely, change it only through functions */
    double x[poisson_not_hamiltonian_DIM];
    double carry[poisson_not_hamiltonian_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                              /* good steps since poisson_not_hamiltonian_init */
    size_t evaluations;                        /* of the generating function, for statistics */
    double t;                                  /* time since poisson_not_hamiltonian_init */
    double h;                                  /* the last step size; NaN before the first step */
    poisson_not_hamiltonian_params params;
    double coef[poisson_not_hamiltonian_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    poisson_not_hamiltonian_history history; /* for starting guesses */
} poisson_not_hamiltonian_solver;
size_t poisson_not_hamiltonian_solver_size(void); /* for bindings to other languages, as what follows */
size_t poisson_not_hamiltonian_solver_steps_done(const poisson_not_hamiltonian_solver *s);

/* Start at x0. params may be NULL for the defaults. poisson_not_hamiltonian_BAD_ARGUMENT, and *s as before,
   if x0, a parameter or what follows from parameters alone is not finite, or one not positive that has to
   be. */
poisson_not_hamiltonian_status poisson_not_hamiltonian_init(poisson_not_hamiltonian_solver *s,
    const poisson_not_hamiltonian_params *params, const double x0[poisson_not_hamiltonian_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
poisson_not_hamiltonian_status poisson_not_hamiltonian_step(poisson_not_hamiltonian_solver *s, double h);
poisson_not_hamiltonian_status poisson_not_hamiltonian_integrate(poisson_not_hamiltonian_solver *s, double h,
    size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   poisson_not_hamiltonian_BAD_ARGUMENT. Either may leave the leaf. */
poisson_not_hamiltonian_status poisson_not_hamiltonian_set_state(poisson_not_hamiltonian_solver *s,
    const double x[poisson_not_hamiltonian_DIM]);
poisson_not_hamiltonian_status poisson_not_hamiltonian_kick(poisson_not_hamiltonian_solver *s,
    const double change[poisson_not_hamiltonian_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
poisson_not_hamiltonian_status poisson_not_hamiltonian_ensemble(const poisson_not_hamiltonian_params *params,
    double *x, size_t members, double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* POISSON_NOT_HAMILTONIAN_H */
