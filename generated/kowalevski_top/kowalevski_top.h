/*
 * The declarations of kowalevski_top.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 19cc964e98c6d9193abf82358f625b963a4865d816bcb676448d97a6f28321a6
 */
#ifndef KOWALEVSKI_TOP_H
#define KOWALEVSKI_TOP_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define kowalevski_top_DIM 6 /* coordinates: P1, P2, P3, G1, G2, G3 */
#define kowalevski_top_ORDER 8
#define kowalevski_top_CASIMIRS 2 /* A, B */
#define kowalevski_top_PHIGEN_VERSION "0.1.0"
#define kowalevski_top_SPEC_SHA256 "2799755b3e3da2be9c8c923424249137334cdb1506fcba1c87c071179c75beaa"
enum { kowalevski_top_COEFFICIENTS = 172 }; /* numbers that depend on params and h only */
enum { kowalevski_top_REMEMBERED = 111 };   /* values that a recurrence is fitted to */
enum { kowalevski_top_WINDOW = 40 };        /* of them that it may use */
enum { kowalevski_top_AHEAD = 8 };          /* values that it foresees */

typedef struct {
    char unused; /* this system has no parameters */
} kowalevski_top_params;
extern const kowalevski_top_params kowalevski_top_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double kowalevski_top_hamiltonian(const kowalevski_top_params *params, const double x[6]);
void kowalevski_top_casimirs(const kowalevski_top_params *params, const double x[6], double out[]);
void kowalevski_top_vector_field(const kowalevski_top_params *params, const double x[6], double out[6]);

typedef enum { kowalevski_top_OK = 0, kowalevski_top_NO_CONVERGENCE, kowalevski_top_SINGULAR,
    kowalevski_top_NOT_FINITE, kowalevski_top_BAD_ARGUMENT } kowalevski_top_status;
const char *kowalevski_top_status_string(kowalevski_top_status status);

enum { kowalevski_top_KEPT = 2 * kowalevski_top_REMEMBERED };

/* Recent values of the unknown of the inner solve, for its starting guess: extrapolated, or by a linear
   recurrence fitted to the last kowalevski_top_REMEMBERED values. For speed only. */
typedef struct {
    int count; /* values in past */
    int extrapolation_order; /* how many of them the extrapolation uses */
    int recurrence_terms; /* how many of them the recurrence uses; 0 if there is none */
    int use_recurrence; /* whether the recurrence is the better guess */
    int fits; /* how often it has been fitted */
    int slow_steps; /* how many of the last steps took more than one iteration */
    int slow_steps_allowed; /* how many of those before it is fitted again */
    double past[kowalevski_top_KEPT][kowalevski_top_DIM]; /* values, the latest last */
    /* of past values, the latest first, for the next */
    double weight[kowalevski_top_WINDOW][kowalevski_top_DIM][kowalevski_top_AHEAD];
} kowalevski_top_history;

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
} kowalevski_top_learnt;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[kowalevski_top_DIM];     /* the state; read it freely, change it only through functions */
    double carry[kowalevski_top_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                     /* good steps since kowalevski_top_init */
    size_t evaluations;               /* of the generating function, for statistics */
    double t;                         /* time since kowalevski_top_init */
    double h;                         /* the last step size; NaN before the first step */
    kowalevski_top_params params;
    double coef[kowalevski_top_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    kowalevski_top_history history; /* for starting guesses */
    kowalevski_top_learnt blocks;
} kowalevski_top_solver;
size_t kowalevski_top_solver_size(void); /* for bindings to other languages, as what follows */
size_t kowalevski_top_solver_steps_done(const kowalevski_top_solver *s);

/* Start at x0. params may be NULL for the defaults. kowalevski_top_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
kowalevski_top_status kowalevski_top_init(kowalevski_top_solver *s, const kowalevski_top_params *params,
    const double x0[kowalevski_top_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
kowalevski_top_status kowalevski_top_step(kowalevski_top_solver *s, double h);
kowalevski_top_status kowalevski_top_integrate(kowalevski_top_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   kowalevski_top_BAD_ARGUMENT. Either may leave the leaf. */
kowalevski_top_status kowalevski_top_set_state(kowalevski_top_solver *s, const double x[kowalevski_top_DIM]);
kowalevski_top_status kowalevski_top_kick(kowalevski_top_solver *s, const double change[kowalevski_top_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
/* Members are integrated side by side in groups; with OpenMP, groups in parallel. */
kowalevski_top_status kowalevski_top_ensemble(const kowalevski_top_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

/* The same where each member has its own parameters params[m] and step h[m]; params may be NULL. */
/* frames (or NULL) receives the states after every stride-th step: frames[(k * kowalevski_top_DIM + i) *
   members + m] is coordinate i of member m after (k + 1) * stride steps, NaN if it failed before. Arrays must
   not overlap. */
kowalevski_top_status kowalevski_top_ensemble_each(const kowalevski_top_params *params, double *x,
    size_t members, const double *h, size_t steps, size_t stride, double *frames, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* KOWALEVSKI_TOP_H */
