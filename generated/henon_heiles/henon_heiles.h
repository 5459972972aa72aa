/*
 * The declarations of henon_heiles.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 39636ce6ed953262621640f81ff3e8875b73bec1a028aba77b6ca2a38f6f91fe
 */
#ifndef HENON_HEILES_H
#define HENON_HEILES_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define henon_heiles_DIM 4 /* coordinates: x, y, px, py */
#define henon_heiles_ORDER 6
#define henon_heiles_CASIMIRS 0
#define henon_heiles_PHIGEN_VERSION "0.1.0"
#define henon_heiles_SPEC_SHA256 "344c927b8e04345779f4c5f13f803b87485fa1196d3f3acdf913e1c4000a502e"
enum { henon_heiles_COEFFICIENTS = 24 }; /* numbers that depend on params and h only */

typedef struct {
    char unused; /* this system has no parameters */
} henon_heiles_params;
extern const henon_heiles_params henon_heiles_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double henon_heiles_hamiltonian(const henon_heiles_params *params, const double x[4]);
void henon_heiles_casimirs(const henon_heiles_params *params, const double x[4], double out[]);
void henon_heiles_vector_field(const henon_heiles_params *params, const double x[4], double out[4]);

typedef enum { henon_heiles_OK = 0, henon_heiles_NO_CONVERGENCE, henon_heiles_SINGULAR,
    henon_heiles_NOT_FINITE, henon_heiles_BAD_ARGUMENT } henon_heiles_status;
const char *henon_heiles_status_string(henon_heiles_status status);

enum { henon_heiles_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[henon_heiles_DIFFERENCES][henon_heiles_DIM];
} henon_heiles_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[henon_heiles_DIM];     /* the state; read it freely, change it only through functions */
    double carry[henon_heiles_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                   /* good steps since henon_heiles_init */
    size_t evaluations;             /* of the generating function, for statistics */
    double t;                       /* time since henon_heiles_init */
    double h;                       /* the last step size; NaN before the first step */
    henon_heiles_params params;
    double coef[henon_heiles_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    henon_heiles_history history; /* for starting guesses */
} henon_heiles_solver;
size_t henon_heiles_solver_size(void); /* for bindings to other languages, as what follows */
size_t henon_heiles_solver_steps_done(const henon_heiles_solver *s);

/* Start at x0. params may be NULL for the defaults. henon_heiles_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
henon_heiles_status henon_heiles_init(henon_heiles_solver *s, const henon_heiles_params *params,
    const double x0[henon_heiles_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
henon_heiles_status henon_heiles_step(henon_heiles_solver *s, double h);
henon_heiles_status henon_heiles_integrate(henon_heiles_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on henon_heiles_BAD_ARGUMENT.
   Either may leave the leaf. */
henon_heiles_status henon_heiles_set_state(henon_heiles_solver *s, const double x[henon_heiles_DIM]);
henon_heiles_status henon_heiles_kick(henon_heiles_solver *s, const double change[henon_heiles_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
henon_heiles_status henon_heiles_ensemble(const henon_heiles_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* HENON_HEILES_H */
