/*
 * The declarations of rigid_body.c. DO NOT EDIT: phigen detects changes by the checksum below.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 5daa06cd5d3050b86b39b9567d90df584a55d6a732faa182180c53b0dcca0320
 */
#ifndef RIGID_BODY_H
#define RIGID_BODY_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define rigid_body_DIM 3      /* coordinates: x1, x2, x3 */
#define rigid_body_ORDER 6    /* order of the method */
#define rigid_body_CASIMIRS 1 /* Casimirs: C */
#define rigid_body_PHIGEN_VERSION "0.1.0"
#define rigid_body_SPEC_SHA256 "b4b33963b7078ab9acec7b44c596aff8b157783c38bfcd02fe22b99e983ef041"
enum { rigid_body_COEFFICIENTS = 35 }; /* number of coefficients: functions of params and h */
enum { rigid_body_GAUGES = 1 };        /* number of Casimirs whose multiples are subtracted from H: `C` */
enum { rigid_body_REMEMBERED = 111 };  /* number of past solutions that the recurrence is fitted to */
enum { rigid_body_WINDOW = 40 };       /* largest number of past solutions in the recurrence */
enum { rigid_body_AHEAD = 8 };         /* number of solutions that the recurrence predicts */

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
const char *rigid_body_status_string(rigid_body_status status); /* the meaning of a status */

enum { rigid_body_STORED_VALUES = 2 * rigid_body_REMEMBERED };

/* Predictor, which affects the speed only: recent solutions of the implicit equation. They give the starting
   value of the next iteration by extrapolation, or by a linear recurrence that is fitted to the last
   rigid_body_REMEMBERED solutions. */
typedef struct {
    int count; /* number of solutions in the array `past` */
    int extrapolation_order; /* number of solutions that the extrapolation uses */
    int recurrence_terms; /* number of solutions that the recurrence uses; 0 if none is fitted */
    int use_recurrence; /* 1 if the recurrence predicts better than the extrapolation */
    int fits; /* number of fits so far */
    int slow_steps; /* recent steps that took more than one iteration */
    int slow_steps_allowed; /* value of slow_steps at which the recurrence is fitted again */
    double past[rigid_body_STORED_VALUES][rigid_body_DIM]; /* solutions, the latest last */
    /* factors of the past solutions, the latest first, in predictions of the next rigid_body_AHEAD
       solutions */
    double weight[rigid_body_WINDOW][rigid_body_DIM][rigid_body_AHEAD];
} rigid_body_history;

/* Measurements that decide whether the next steps are solved together, as a block in SIMD registers, or one
   by one. They affect the speed only. */
typedef struct {
    double evaluations_per_stage; /* running mean of the evaluations in a stage of a single step */
    int single_steps;             /* number of single steps to make before the next block */
    /* value of single_steps after the last failed block, halved by each successful block */
    int last_single_steps;
    int use_recurrences;              /* 1 if recurrences predict blocks, 0 if Runge-Kutta steps do */
    int passes_without_recurrences;   /* iterations that the latest block without recurrences took */
    size_t steps_without_recurrences; /* steps to wait before recurrences are tried again */
    size_t recurrences_from_step;     /* number of the step from which recurrences are tried again */
} rigid_body_block_measurements;

/* A copy of this struct is an independent solver. Arguments of functions may point into it, or overlap. */
typedef struct {
    double x[rigid_body_DIM]; /* the state; change it only by the functions below */
    double carry[rigid_body_DIM]; /* rounding error of x: x + carry is more accurate */
    size_t steps; /* number of successful steps since rigid_body_init */
    size_t evaluations; /* number of evaluations of the generating function, for statistics */
    double t; /* time since rigid_body_init */
    double h; /* size of the last step; NaN before the first step */
    rigid_body_params params; /* the parameters, set by rigid_body_init; do not change them */
    double gauge[rigid_body_GAUGES]; /* gauge[k] times Casimir k is subtracted from H */
    double coef[rigid_body_COEFFICIENTS]; /* functions of params and h, computed when h changes */
    size_t steps_before_h; /* steps and t at the last change of h: t = t_before_h + (steps since then) h */
    double t_before_h;
    rigid_body_history history;           /* predictor of the starting value of the iteration */
    rigid_body_block_measurements blocks; /* measurements that decide when steps are made in blocks */
} rigid_body_solver;
size_t rigid_body_solver_size(void); /* in bytes, for languages that cannot read the struct */
size_t rigid_body_solver_steps_done(const rigid_body_solver *s);

/* Initialise *s with the state x0; params = NULL for the defaults. Returns rigid_body_BAD_ARGUMENT, with *s
   unchanged, if a value or coefficient is not finite, or a parameter that must be positive is not. */
rigid_body_status rigid_body_init(rigid_body_solver *s, const rigid_body_params *params,
    const double x0[rigid_body_DIM]);

/* As rigid_body_init, with a given gauge: steps subtract gauge[k] times Casimir k from H. */
rigid_body_status rigid_body_init_gauge(rigid_body_solver *s, const rigid_body_params *params,
    const double x0[rigid_body_DIM], const double gauge[rigid_body_GAUGES]);

/* Make steps of size h, of either sign. If a step fails, s->x and s->steps remain those before this step. */
rigid_body_status rigid_body_step(rigid_body_solver *s, double h);
rigid_body_status rigid_body_integrate(rigid_body_solver *s, double h, size_t steps);

/* Between steps: replace the state by x, or add `change` to the state. The values of Casimirs may change.
   Returns rigid_body_BAD_ARGUMENT, with *s unchanged, if the new state is not finite. */
rigid_body_status rigid_body_set_state(rigid_body_solver *s, const double x[rigid_body_DIM]);
rigid_body_status rigid_body_kick(rigid_body_solver *s, const double change[rigid_body_DIM]);

/* Between steps: replace the parameters; the state is unchanged. Returns rigid_body_BAD_ARGUMENT, with *s
   unchanged, for parameters that rigid_body_init refuses. */
/* The factors of Casimirs in s->gauge are unchanged. */
rigid_body_status rigid_body_set_parameters(rigid_body_solver *s, const rigid_body_params *params);

/* Integrate members in place: x[i * members + m] is coordinate i of member m. Failed members get their last
   good state. status[m] is for member m; `status` may be NULL. Returns the first status that is not OK. */
/* Members are integrated in SIMD batches; with OpenMP, the batches are integrated in parallel. */
rigid_body_status rigid_body_ensemble(const rigid_body_params *params, double *x, size_t members, double h,
    size_t steps, unsigned char *status);

/* As rigid_body_ensemble, for members with parameters params[m], step size h[m], and gauge: gauge[m *
   rigid_body_GAUGES + k] times Casimir k is subtracted from H. params may be NULL for the defaults, gauge for
   factors chosen at the initial states. */
/* `frames`, if not NULL, receives the states after every stride-th step: frames[(k * rigid_body_DIM + i) *
   members + m] is coordinate i of member m after (k + 1) * stride steps, NaN if the member failed before.
   Arrays must not overlap. */
rigid_body_status rigid_body_ensemble_each(const rigid_body_params *params, double *x, size_t members,
    const double *gauge, const double *h, size_t steps, size_t stride, double *frames, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* RIGID_BODY_H */
