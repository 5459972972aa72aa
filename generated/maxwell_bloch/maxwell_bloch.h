/*
 * maxwell_bloch.h: the declarations; maxwell_bloch.c says how they were made.
 * DO NOT EDIT: edits are noticed by the checksum below.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 4c6e175fedb6b03a8490d96a031feb64b3b08b78929033a40f6cb4af1184bd3c
 */
#ifndef MAXWELL_BLOCH_H
#define MAXWELL_BLOCH_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define maxwell_bloch_DIM 3
#define maxwell_bloch_ORDER 4
#define maxwell_bloch_CASIMIRS 1
#define maxwell_bloch_PHIGEN_VERSION "0.1.0"
#define maxwell_bloch_SPEC_SHA256 "624a938a8bb2adf6721f7be0bad529b807bbe017cc3b22a2d1819ff654f45cf0"
enum { maxwell_bloch_COEFFICIENTS = 3 }; /* numbers that depend on params and h only */

/* State vectors: x, y, z. Casimirs: C. */
typedef struct {
    char unused; /* this system has no parameters */
} maxwell_bloch_params;
extern const maxwell_bloch_params maxwell_bloch_default_params;

/* How a step ends; maxwell_bloch_status_string says it in words. */
typedef enum { maxwell_bloch_OK = 0, maxwell_bloch_NO_CONVERGENCE, maxwell_bloch_SINGULAR,
    maxwell_bloch_NOT_FINITE, maxwell_bloch_BAD_ARGUMENT } maxwell_bloch_status;
const char *maxwell_bloch_status_string(maxwell_bloch_status status);

enum { maxwell_bloch_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[maxwell_bloch_DIFFERENCES][maxwell_bloch_DIM];
} maxwell_bloch_history;

/* The solver is a plain value: copy it to branch, keep one per thread. Set it up with maxwell_bloch_init. */
typedef struct {
    double x[maxwell_bloch_DIM];     /* the state; read it freely, change it only through functions */
    double carry[maxwell_bloch_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                    /* good steps since maxwell_bloch_init */
    size_t evaluations;              /* of the generating function, for statistics */
    double t;                        /* time since maxwell_bloch_init */
    double h;                        /* the last step size; NaN before the first step */
    maxwell_bloch_params params;
    double coef[maxwell_bloch_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    maxwell_bloch_history history; /* for starting guesses */
} maxwell_bloch_solver;

/* Start at x0. params may be NULL for the defaults. Arguments of all functions may be parts of the solver, or
   overlap. maxwell_bloch_BAD_ARGUMENT, and *s as before, if x0 or a parameter is not finite, one that has to
   be positive is not, or what is computed from parameters alone is not finite. */
maxwell_bloch_status maxwell_bloch_init(maxwell_bloch_solver *s, const maxwell_bloch_params *params,
    const double x0[maxwell_bloch_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
maxwell_bloch_status maxwell_bloch_step(maxwell_bloch_solver *s, double h);
maxwell_bloch_status maxwell_bloch_integrate(maxwell_bloch_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on maxwell_bloch_BAD_ARGUMENT.
   Either may leave the leaf. */
maxwell_bloch_status maxwell_bloch_set_state(maxwell_bloch_solver *s, const double x[maxwell_bloch_DIM]);
maxwell_bloch_status maxwell_bloch_kick(maxwell_bloch_solver *s, const double change[maxwell_bloch_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
maxwell_bloch_status maxwell_bloch_ensemble(const maxwell_bloch_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double maxwell_bloch_hamiltonian(const maxwell_bloch_params *params, const double x[maxwell_bloch_DIM]);
void maxwell_bloch_casimirs(const maxwell_bloch_params *params, const double x[maxwell_bloch_DIM],
    double out[]);
void maxwell_bloch_vector_field(const maxwell_bloch_params *params, const double x[maxwell_bloch_DIM],
    double out[maxwell_bloch_DIM]);

/* For bindings: the size of maxwell_bloch_solver, and its count of good steps. */
size_t maxwell_bloch_solver_size(void);
size_t maxwell_bloch_solver_steps_done(const maxwell_bloch_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* MAXWELL_BLOCH_H */
