/*
 * The declarations of lotka_volterra.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 2c86be20f926f79df9bb6c6299193531f9b572906d65169ea57d548bbdbafd34
 */
#ifndef LOTKA_VOLTERRA_H
#define LOTKA_VOLTERRA_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define lotka_volterra_DIM 3 /* coordinates: x1, x2, x3 */
#define lotka_volterra_ORDER 2
#define lotka_volterra_CASIMIRS 1 /* C */
#define lotka_volterra_PHIGEN_VERSION "0.1.0"
#define lotka_volterra_SPEC_SHA256 "a253a78f7e0887e5a834a02b0b1f47451af2de51574fd76b016f875f92baa539"
enum { lotka_volterra_COEFFICIENTS = 1 }; /* numbers that depend on params and h only */
enum { lotka_volterra_REMEMBERED = 111 }; /* values that a recurrence is fitted to */
enum { lotka_volterra_WINDOW = 40 };      /* of them that it may use */
enum { lotka_volterra_AHEAD = 8 };        /* values that it foresees */

typedef struct {
    char unused; /* this system has no parameters */
} lotka_volterra_params;
extern const lotka_volterra_params lotka_volterra_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double lotka_volterra_hamiltonian(const lotka_volterra_params *params, const double x[3]);
void lotka_volterra_casimirs(const lotka_volterra_params *params, const double x[3], double out[]);
void lotka_volterra_vector_field(const lotka_volterra_params *params, const double x[3], double out[3]);

typedef enum { lotka_volterra_OK = 0, lotka_volterra_NO_CONVERGENCE, lotka_volterra_SINGULAR,
    lotka_volterra_NOT_FINITE, lotka_volterra_BAD_ARGUMENT } lotka_volterra_status;
const char *lotka_volterra_status_string(lotka_volterra_status status);

enum { lotka_volterra_KEPT = 2 * lotka_volterra_REMEMBERED };

/* Recent values of the unknown of the inner solve, for its starting guess: extrapolated, or by a linear
   recurrence fitted to the last lotka_volterra_REMEMBERED values. For speed only. */
typedef struct {
    int count; /* values in past */
    int extrapolation_order; /* how many of them the extrapolation uses */
    int recurrence_terms; /* how many of them the recurrence uses; 0 if there is none */
    int use_recurrence; /* whether the recurrence is the better guess */
    int fits; /* how often it has been fitted */
    int slow_steps; /* how many of the last steps took more than one iteration */
    int slow_steps_allowed; /* how many of those before it is fitted again */
    double past[lotka_volterra_KEPT][lotka_volterra_DIM]; /* values, the latest last */
    /* of past values, the latest first, for the next */
    double weight[lotka_volterra_WINDOW][lotka_volterra_DIM][lotka_volterra_AHEAD];
} lotka_volterra_history;

/* What was learnt about blocks of steps. For speed only. */
typedef struct {
    double evaluations_per_stage; /* that single steps take */
    int single_steps;             /* to make before a block is tried */
    /* the same after the last failure, halved with every block that succeeds */
    int last_single_steps;
    int use_recurrences;              /* whether blocks are guessed by recurrences */
    int passes_without_recurrences;   /* that the last block took which was guessed by Runge-Kutta steps */
    size_t steps_without_recurrences; /* to wait before recurrences are tried again */
    size_t recurrences_from_step;     /* when that is */
} lotka_volterra_learnt;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[lotka_volterra_DIM];     /* the state; read it freely, change it only through functions */
    double carry[lotka_volterra_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                     /* good steps since lotka_volterra_init */
    size_t evaluations;               /* of the generating function, for statistics */
    double t;                         /* time since lotka_volterra_init */
    double h;                         /* the last step size; NaN before the first step */
    lotka_volterra_params params;
    double coef[lotka_volterra_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    lotka_volterra_history history; /* for starting guesses */
    lotka_volterra_learnt blocks;
} lotka_volterra_solver;
size_t lotka_volterra_solver_size(void); /* for bindings to other languages, as what follows */
size_t lotka_volterra_solver_steps_done(const lotka_volterra_solver *s);

/* Start at x0. params may be NULL for the defaults. lotka_volterra_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
lotka_volterra_status lotka_volterra_init(lotka_volterra_solver *s, const lotka_volterra_params *params,
    const double x0[lotka_volterra_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
lotka_volterra_status lotka_volterra_step(lotka_volterra_solver *s, double h);
lotka_volterra_status lotka_volterra_integrate(lotka_volterra_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   lotka_volterra_BAD_ARGUMENT. Either may leave the leaf. */
lotka_volterra_status lotka_volterra_set_state(lotka_volterra_solver *s, const double x[lotka_volterra_DIM]);
lotka_volterra_status lotka_volterra_kick(lotka_volterra_solver *s, const double change[lotka_volterra_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
/* Members are integrated side by side in groups; with OpenMP, groups in parallel. */
lotka_volterra_status lotka_volterra_ensemble(const lotka_volterra_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

/* The same where each member has its own parameters params[m] and step h[m]; params may be NULL. */
/* frames (or NULL) receives the states after every stride-th step: frames[(k * lotka_volterra_DIM + i) *
   members + m] is coordinate i of member m after (k + 1) * stride steps, NaN if it failed before. Arrays must
   not overlap. */
lotka_volterra_status lotka_volterra_ensemble_each(const lotka_volterra_params *params, double *x,
    size_t members, const double *h, size_t steps, size_t stride, double *frames, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* LOTKA_VOLTERRA_H */
