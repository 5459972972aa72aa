/*
 * The declarations of rigid_body.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 11f8f4e75e3f6dcf5dc5edd6afb2a1f7de938bb96e4050666ef4a53b39ce8e3a
 */
#ifndef RIGID_BODY_H
#define RIGID_BODY_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define rigid_body_DIM 3 /* coordinates: x1, x2, x3 */
#define rigid_body_ORDER 6
#define rigid_body_CASIMIRS 1 /* C */
#define rigid_body_PHIGEN_VERSION "0.1.0"
#define rigid_body_SPEC_SHA256 "8810186c1e0019884e5b3b03e44e3be202fcaec17d97ceab9967252a6cdb2d99"
enum { rigid_body_COEFFICIENTS = 35 }; /* numbers that depend on params and h only */
enum { rigid_body_GAUGES = 1 };        /* Casimirs whose multiples are taken from H: C */
enum { rigid_body_REMEMBERED = 111 };  /* values that a recurrence is fitted to */
enum { rigid_body_WINDOW = 40 };       /* of them that it may use */
enum { rigid_body_AHEAD = 8 };         /* values that it foresees */

typedef struct {
    double I1; /* first principal moment of inertia */
    double I2; /* second principal moment of inertia */
    double I3; /* third principal moment of inertia */
} rigid_body_params;
extern const rigid_body_params rigid_body_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double rigid_body_hamiltonian(const rigid_body_params *params, const double x[3]);
void rigid_body_casimirs(const rigid_body_params *params, const double x[3], double out[]);
void rigid_body_vector_field(const rigid_body_params *params, const double x[3], double out[3]);

typedef enum { rigid_body_OK = 0, rigid_body_NO_CONVERGENCE, rigid_body_SINGULAR, rigid_body_NOT_FINITE,
    rigid_body_BAD_ARGUMENT } rigid_body_status;
const char *rigid_body_status_string(rigid_body_status status);

enum { rigid_body_KEPT = 2 * rigid_body_REMEMBERED };

/* Recent values of the unknown of the inner solve, for its starting guess: extrapolated, or by a linear
   recurrence fitted to the last rigid_body_REMEMBERED values. For speed only. */
typedef struct {
    int count; /* values in past */
    int extrapolation_order; /* how many of them the extrapolation uses */
    int recurrence_terms; /* how many of them the recurrence uses; 0 if there is none */
    int use_recurrence; /* whether the recurrence is the better guess */
    int fits; /* how often it has been fitted */
    int slow_steps; /* how many of the last steps took more than one iteration */
    int slow_steps_allowed; /* how many of those before it is fitted again */
    double past[rigid_body_KEPT][rigid_body_DIM]; /* values, the latest last */
    /* of past values, the latest first, for the next */
    double weight[rigid_body_WINDOW][rigid_body_DIM][rigid_body_AHEAD];
} rigid_body_history;

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
} rigid_body_learnt;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[rigid_body_DIM];     /* the state; read it freely, change it only through functions */
    double carry[rigid_body_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                 /* good steps since rigid_body_init */
    size_t evaluations;           /* of the generating function, for statistics */
    double t;                     /* time since rigid_body_init */
    double h;                     /* the last step size; NaN before the first step */
    rigid_body_params params;
    double gauge[rigid_body_GAUGES]; /* multiples of Casimirs that are taken from H, in their order */
    double coef[rigid_body_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    rigid_body_history history; /* for starting guesses */
    rigid_body_learnt blocks;
} rigid_body_solver;
size_t rigid_body_solver_size(void); /* for bindings to other languages, as what follows */
size_t rigid_body_solver_steps_done(const rigid_body_solver *s);

/* Start at x0. params may be NULL for the defaults. rigid_body_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
rigid_body_status rigid_body_init(rigid_body_solver *s, const rigid_body_params *params,
    const double x0[rigid_body_DIM]);

/* Start at x0 with a gauge of one's own: the step is an exact Poisson map for each fixed gauge. */
rigid_body_status rigid_body_init_gauge(rigid_body_solver *s, const rigid_body_params *params,
    const double x0[rigid_body_DIM], const double gauge[rigid_body_GAUGES]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
rigid_body_status rigid_body_step(rigid_body_solver *s, double h);
rigid_body_status rigid_body_integrate(rigid_body_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on rigid_body_BAD_ARGUMENT.
   Either may leave the leaf. */
rigid_body_status rigid_body_set_state(rigid_body_solver *s, const double x[rigid_body_DIM]);
rigid_body_status rigid_body_kick(rigid_body_solver *s, const double change[rigid_body_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
/* Members are integrated side by side in groups; with OpenMP, groups in parallel. */
rigid_body_status rigid_body_ensemble(const rigid_body_params *params, double *x, size_t members, double h,
    size_t steps, unsigned char *status);

/* The same where each member has its own parameters params[m], gauge &gauge[m * rigid_body_GAUGES] and step
   h[m]; params and gauge may be NULL. */
/* frames (or NULL) receives the states after every stride-th step: frames[(k * rigid_body_DIM + i) * members
   + m] is coordinate i of member m after (k + 1) * stride steps, NaN if it failed before. Arrays must not
   overlap. */
rigid_body_status rigid_body_ensemble_each(const rigid_body_params *params, double *x, size_t members,
    const double *gauge, const double *h, size_t steps, size_t stride, double *frames, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* RIGID_BODY_H */
