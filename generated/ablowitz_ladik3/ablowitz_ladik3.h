/*
 * The declarations of ablowitz_ladik3.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 519b6e0dc3a1097dff4f6df2a551547fe8ac0c112d09d44e1202784eb6a3bf7a
 */
#ifndef ABLOWITZ_LADIK3_H
#define ABLOWITZ_LADIK3_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define ablowitz_ladik3_DIM 6 /* coordinates: x1, y1, x2, y2, x3, y3 */
#define ablowitz_ladik3_ORDER 4
#define ablowitz_ladik3_CASIMIRS 0
#define ablowitz_ladik3_PHIGEN_VERSION "0.1.0"
#define ablowitz_ladik3_SPEC_SHA256 "522a22e2eba41e15ba83081c2557c3d42d94541601f5914945494027ebf938e2"
enum { ablowitz_ladik3_STAGES = 5 };       /* of a step */
enum { ablowitz_ladik3_COEFFICIENTS = 3 }; /* numbers that depend on params and h only */

typedef struct {
    char unused; /* this system has no parameters */
} ablowitz_ladik3_params;
extern const ablowitz_ladik3_params ablowitz_ladik3_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double ablowitz_ladik3_hamiltonian(const ablowitz_ladik3_params *params, const double x[6]);
void ablowitz_ladik3_casimirs(const ablowitz_ladik3_params *params, const double x[6], double out[]);
void ablowitz_ladik3_vector_field(const ablowitz_ladik3_params *params, const double x[6], double out[6]);

typedef enum { ablowitz_ladik3_OK = 0, ablowitz_ladik3_NO_CONVERGENCE, ablowitz_ladik3_SINGULAR,
    ablowitz_ladik3_NOT_FINITE, ablowitz_ladik3_BAD_ARGUMENT } ablowitz_ladik3_status;
const char *ablowitz_ladik3_status_string(ablowitz_ladik3_status status);

enum { ablowitz_ladik3_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[ablowitz_ladik3_DIFFERENCES][ablowitz_ladik3_DIM];
} ablowitz_ladik3_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[ablowitz_ladik3_DIM];     /* the state; read it freely, change it only through functions */
    double carry[ablowitz_ladik3_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                      /* good steps since ablowitz_ladik3_init */
    size_t evaluations;                /* of the generating function, for statistics */
    double t;                          /* time since ablowitz_ladik3_init */
    double h;                          /* the last step size; NaN before the first step */
    ablowitz_ladik3_params params;
    /* all that depends on params and h only */
    double coef[ablowitz_ladik3_STAGES][ablowitz_ladik3_COEFFICIENTS];
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    ablowitz_ladik3_history history[ablowitz_ladik3_STAGES]; /* for starting guesses */
} ablowitz_ladik3_solver;
size_t ablowitz_ladik3_solver_size(void); /* for bindings to other languages, as what follows */
size_t ablowitz_ladik3_solver_steps_done(const ablowitz_ladik3_solver *s);

/* Start at x0. params may be NULL for the defaults. ablowitz_ladik3_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
ablowitz_ladik3_status ablowitz_ladik3_init(ablowitz_ladik3_solver *s, const ablowitz_ladik3_params *params,
    const double x0[ablowitz_ladik3_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
ablowitz_ladik3_status ablowitz_ladik3_step(ablowitz_ladik3_solver *s, double h);
ablowitz_ladik3_status ablowitz_ladik3_integrate(ablowitz_ladik3_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   ablowitz_ladik3_BAD_ARGUMENT. Either may leave the leaf. */
ablowitz_ladik3_status ablowitz_ladik3_set_state(ablowitz_ladik3_solver *s,
    const double x[ablowitz_ladik3_DIM]);
ablowitz_ladik3_status ablowitz_ladik3_kick(ablowitz_ladik3_solver *s,
    const double change[ablowitz_ladik3_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
ablowitz_ladik3_status ablowitz_ladik3_ensemble(const ablowitz_ladik3_params *params, double *x,
    size_t members, double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* ABLOWITZ_LADIK3_H */
