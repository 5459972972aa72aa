/*
 * The declarations of rigid_body_paper.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: df0bc0473a5c30439c3be800d90878e7b53f6814613dfbb836fd44e23368c623
 */
#ifndef RIGID_BODY_PAPER_H
#define RIGID_BODY_PAPER_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define rigid_body_paper_DIM 3 /* coordinates: x1, x2, x3 */
#define rigid_body_paper_ORDER 2
#define rigid_body_paper_CASIMIRS 1 /* C */
#define rigid_body_paper_PHIGEN_VERSION "0.1.0"
#define rigid_body_paper_SPEC_SHA256 "fdf2d9a528753bef04cdf4e448b386ab40d533eb21d1b8fc60aed87613d78d3e"
enum { rigid_body_paper_COEFFICIENTS = 3 }; /* numbers that depend on params and h only */

typedef struct {
    double J1; /* default 1.0 */
    double J2; /* default 3.141592653589793 */
    double J3; /* default 100.0 */
} rigid_body_paper_params;
extern const rigid_body_paper_params rigid_body_paper_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double rigid_body_paper_hamiltonian(const rigid_body_paper_params *params, const double x[3]);
void rigid_body_paper_casimirs(const rigid_body_paper_params *params, const double x[3], double out[]);
void rigid_body_paper_vector_field(const rigid_body_paper_params *params, const double x[3], double out[3]);

typedef enum { rigid_body_paper_OK = 0, rigid_body_paper_NO_CONVERGENCE, rigid_body_paper_SINGULAR,
    rigid_body_paper_NOT_FINITE, rigid_body_paper_BAD_ARGUMENT } rigid_body_paper_status;
const char *rigid_body_paper_status_string(rigid_body_paper_status status);

enum { rigid_body_paper_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[rigid_body_paper_DIFFERENCES][rigid_body_paper_DIM];
} rigid_body_paper_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[rigid_body_paper_DIM];     /* the state; read it freely, change it only through functions */
    double carry[rigid_body_paper_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                       /* good steps since rigid_body_paper_init */
    size_t evaluations;                 /* of the generating function, for statistics */
    double t;                           /* time since rigid_body_paper_init */
    double h;                           /* the last step size; NaN before the first step */
    rigid_body_paper_params params;
    double coef[rigid_body_paper_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    rigid_body_paper_history history; /* for starting guesses */
} rigid_body_paper_solver;
size_t rigid_body_paper_solver_size(void); /* for bindings to other languages, as what follows */
size_t rigid_body_paper_solver_steps_done(const rigid_body_paper_solver *s);

/* Start at x0. params may be NULL for the defaults. rigid_body_paper_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
rigid_body_paper_status rigid_body_paper_init(rigid_body_paper_solver *s,
    const rigid_body_paper_params *params, const double x0[rigid_body_paper_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
rigid_body_paper_status rigid_body_paper_step(rigid_body_paper_solver *s, double h);
rigid_body_paper_status rigid_body_paper_integrate(rigid_body_paper_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   rigid_body_paper_BAD_ARGUMENT. Either may leave the leaf. */
rigid_body_paper_status rigid_body_paper_set_state(rigid_body_paper_solver *s,
    const double x[rigid_body_paper_DIM]);
rigid_body_paper_status rigid_body_paper_kick(rigid_body_paper_solver *s,
    const double change[rigid_body_paper_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
rigid_body_paper_status rigid_body_paper_ensemble(const rigid_body_paper_params *params, double *x,
    size_t members, double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* RIGID_BODY_PAPER_H */
