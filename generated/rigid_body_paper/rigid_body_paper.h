/*
 * rigid_body_paper.h: the declarations; rigid_body_paper.c says how they were made.
 * DO NOT EDIT: edits are noticed by the checksum below.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 1620db202d51d63c82a25048b88438142f0db461861e8b9b44877df2b2d9cab9
 */
#ifndef RIGID_BODY_PAPER_H
#define RIGID_BODY_PAPER_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define rigid_body_paper_DIM 3
#define rigid_body_paper_ORDER 2
#define rigid_body_paper_CASIMIRS 1
#define rigid_body_paper_PHIGEN_VERSION "0.1.0"
#define rigid_body_paper_SPEC_SHA256 "fdf2d9a528753bef04cdf4e448b386ab40d533eb21d1b8fc60aed87613d78d3e"
enum { rigid_body_paper_COEFFICIENTS = 3 }; /* numbers that depend on params and h only */

/* State vectors: x1, x2, x3. Casimirs: C. */
typedef struct {
    double J1; /* default 1.0 */
    double J2; /* default 3.141592653589793 */
    double J3; /* default 100.0 */
} rigid_body_paper_params;
extern const rigid_body_paper_params rigid_body_paper_default_params;

/* How a step ends; rigid_body_paper_status_string says it in words. */
typedef enum { rigid_body_paper_OK = 0, rigid_body_paper_NO_CONVERGENCE, rigid_body_paper_SINGULAR,
    rigid_body_paper_NOT_FINITE, rigid_body_paper_BAD_ARGUMENT } rigid_body_paper_status;
const char *rigid_body_paper_status_string(rigid_body_paper_status status);

enum { rigid_body_paper_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[rigid_body_paper_DIFFERENCES][rigid_body_paper_DIM];
} rigid_body_paper_history;

/* The solver is a plain value: copy it to branch, keep one per thread. Set it up with
   rigid_body_paper_init. */
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

/* Start at x0. params may be NULL for the defaults. Arguments of all functions may be parts of the solver, or
   overlap. rigid_body_paper_BAD_ARGUMENT, and *s as before, if x0 or a parameter is not finite, one that has
   to be positive is not, or what is computed from parameters alone is not finite. */
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

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double rigid_body_paper_hamiltonian(const rigid_body_paper_params *params,
    const double x[rigid_body_paper_DIM]);
void rigid_body_paper_casimirs(const rigid_body_paper_params *params, const double x[rigid_body_paper_DIM],
    double out[]);
void rigid_body_paper_vector_field(const rigid_body_paper_params *params,
    const double x[rigid_body_paper_DIM], double out[rigid_body_paper_DIM]);

/* For bindings: the size of rigid_body_paper_solver, and its count of good steps. */
size_t rigid_body_paper_solver_size(void);
size_t rigid_body_paper_solver_steps_done(const rigid_body_paper_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* RIGID_BODY_PAPER_H */
