/*
 * The declarations of maxwell_bloch.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: b1e625c76fa0f122584473757f17f1a88f3d9765c4f7fc65a16b174ec520bc6e
 */
#ifndef MAXWELL_BLOCH_H
#define MAXWELL_BLOCH_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define maxwell_bloch_DIM 3 /* coordinates: x, y, z */
#define maxwell_bloch_ORDER 4
#define maxwell_bloch_CASIMIRS 1 /* C */
#define maxwell_bloch_PHIGEN_VERSION "0.1.0"
#define maxwell_bloch_SPEC_SHA256 "624a938a8bb2adf6721f7be0bad529b807bbe017cc3b22a2d1819ff654f45cf0"
enum { maxwell_bloch_COEFFICIENTS = 3 }; /* numbers that depend on params and h only */

typedef struct {
    char unused; /* this system has no parameters */
} maxwell_bloch_params;
extern const maxwell_bloch_params maxwell_bloch_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double maxwell_bloch_hamiltonian(const maxwell_bloch_params *params, const double x[3]);
void maxwell_bloch_casimirs(const maxwell_bloch_params *params, const double x[3], double out[]);
void maxwell_bloch_vector_field(const maxwell_bloch_params *params, const double x[3], double out[3]);

typedef enum { maxwell_bloch_OK = 0, maxwell_bloch_NO_CONVERGENCE, maxwell_bloch_SINGULAR,
    maxwell_bloch_NOT_FINITE, maxwell_bloch_BAD_ARGUMENT } maxwell_bloch_status;
const char *maxwell_bloch_status_string(maxwell_bloch_status status);

enum { maxwell_bloch_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[maxwell_bloch_DIFFERENCES][maxwell_bloch_DIM];
} maxwell_bloch_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
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
size_t maxwell_bloch_solver_size(void); /* for bindings to other languages, as what follows */
size_t maxwell_bloch_solver_steps_done(const maxwell_bloch_solver *s);

/* Start at x0. params may be NULL for the defaults. maxwell_bloch_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
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

#ifdef __cplusplus
}
#endif
#endif /* MAXWELL_BLOCH_H */
