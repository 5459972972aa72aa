/*
 * The declarations of nambu_pendulum.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 20bf672db1a33f9efd3998d1e08bdad8c4c66b0eee066363ad981613009edb93
 */
#ifndef NAMBU_PENDULUM_H
#define NAMBU_PENDULUM_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define nambu_pendulum_DIM 3 /* coordinates: theta, p, V */
#define nambu_pendulum_ORDER 4
#define nambu_pendulum_CASIMIRS 1 /* C */
#define nambu_pendulum_PHIGEN_VERSION "0.1.0"
#define nambu_pendulum_SPEC_SHA256 "4a482cc6c1e66da787de49d9112e6ca1c38e0b9e783293e47090388bbe60f416"
enum { nambu_pendulum_COEFFICIENTS = 3 }; /* numbers that depend on params and h only */
enum { nambu_pendulum_REMEMBERED = 111 }; /* values that a recurrence is fitted to */
enum { nambu_pendulum_WINDOW = 40 };      /* of them that it may use */
enum { nambu_pendulum_AHEAD = 8 };        /* values that it foresees */

typedef struct {
    char unused; /* this system has no parameters */
} nambu_pendulum_params;
extern const nambu_pendulum_params nambu_pendulum_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double nambu_pendulum_hamiltonian(const nambu_pendulum_params *params, const double x[3]);
void nambu_pendulum_casimirs(const nambu_pendulum_params *params, const double x[3], double out[]);
void nambu_pendulum_vector_field(const nambu_pendulum_params *params, const double x[3], double out[3]);

typedef enum { nambu_pendulum_OK = 0, nambu_pendulum_NO_CONVERGENCE, nambu_pendulum_SINGULAR,
    nambu_pendulum_NOT_FINITE, nambu_pendulum_BAD_ARGUMENT } nambu_pendulum_status;
const char *nambu_pendulum_status_string(nambu_pendulum_status status);

enum { nambu_pendulum_KEPT = 2 * nambu_pendulum_REMEMBERED };

/* Recent values of the unknown of the inner solve, for its starting guess: extrapolated, or by a linear
   recurrence fitted to the last nambu_pendulum_REMEMBERED values. For speed only. */
typedef struct {
    int count; /* values in past */
    int extrapolation_order; /* how many of them the extrapolation uses */
    int recurrence_terms; /* how many of them the recurrence uses; 0 if there is none */
    int use_recurrence; /* whether the recurrence is the better guess */
    int fits; /* how often it has been fitted */
    int slow_steps; /* how many of the last steps took more than one iteration */
    int slow_steps_allowed; /* how many of those before it is fitted again */
    double past[nambu_pendulum_KEPT][nambu_pendulum_DIM]; /* values, the latest last */
    /* of past values, the latest first, for the next */
    double weight[nambu_pendulum_WINDOW][nambu_pendulum_DIM][nambu_pendulum_AHEAD];
} nambu_pendulum_history;

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
} nambu_pendulum_learnt;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[nambu_pendulum_DIM];     /* the state; read it freely, change it only through functions */
    double carry[nambu_pendulum_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                     /* good steps since nambu_pendulum_init */
    size_t evaluations;               /* of the generating function, for statistics */
    double t;                         /* time since nambu_pendulum_init */
    double h;                         /* the last step size; NaN before the first step */
    nambu_pendulum_params params;
    double coef[nambu_pendulum_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    nambu_pendulum_history history; /* for starting guesses */
    nambu_pendulum_learnt blocks;
} nambu_pendulum_solver;
size_t nambu_pendulum_solver_size(void); /* for bindings to other languages, as what follows */
size_t nambu_pendulum_solver_steps_done(const nambu_pendulum_solver *s);

/* Start at x0. params may be NULL for the defaults. nambu_pendulum_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
nambu_pendulum_status nambu_pendulum_init(nambu_pendulum_solver *s, const nambu_pendulum_params *params,
    const double x0[nambu_pendulum_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
nambu_pendulum_status nambu_pendulum_step(nambu_pendulum_solver *s, double h);
nambu_pendulum_status nambu_pendulum_integrate(nambu_pendulum_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   nambu_pendulum_BAD_ARGUMENT. Either may leave the leaf. */
nambu_pendulum_status nambu_pendulum_set_state(nambu_pendulum_solver *s, const double x[nambu_pendulum_DIM]);
nambu_pendulum_status nambu_pendulum_kick(nambu_pendulum_solver *s, const double change[nambu_pendulum_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
/* Members are integrated side by side in groups; with OpenMP, groups in parallel. */
nambu_pendulum_status nambu_pendulum_ensemble(const nambu_pendulum_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

/* The same where each member has its own parameters params[m] and step h[m]; params may be NULL. */
/* frames (or NULL) receives the states after every stride-th step: frames[(k * nambu_pendulum_DIM + i) *
   members + m] is coordinate i of member m after (k + 1) * stride steps, NaN if it failed before. Arrays must
   not overlap. */
nambu_pendulum_status nambu_pendulum_ensemble_each(const nambu_pendulum_params *params, double *x,
    size_t members, const double *h, size_t steps, size_t stride, double *frames, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* NAMBU_PENDULUM_H */
