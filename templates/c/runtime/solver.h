#ifndef PHI_FILE_SOLVER_H
#define PHI_FILE_SOLVER_H
#include "declarations.h"
#include "phrases.h"
#include "status.h"
const char *phi_status_string(phi_status status);

#if PHI_GAUSS
/* What the last step tells of the next one. For speed only. */
typedef struct {
    int count;   /* 0 before the first step */
    int sweeps;  /* that the last step took */
    double rate; /* at which changes of sweeps shrink */
    double moves[PHI_UNKNOWNS][PHI_WIDTH]; /* of the stages of the last step, in the frame of its start */
} phi_history;

#elif PHI_GUESSED && !PHI_RECURRENCES
/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[PHI_DIFFERENCES][PHI_DIM];
} phi_history;

#endif
#if PHI_RECURRENCES
enum { PHI_KEPT = 2 * PHI_REMEMBERED };

/* Recent values of the unknown of the inner solve, for its starting guess: extrapolated, or by a linear recurrence
   fitted to the last PHI_REMEMBERED values. For speed only. */
typedef struct {
    int count;                       /* values in past */
    int extrapolation_order;         /* how many of them the extrapolation uses */
    int recurrence_terms;            /* how many of them the recurrence uses; 0 if there is none */
    int use_recurrence;              /* whether the recurrence is the better guess */
    int fits;                        /* how often it has been fitted */
    int slow_steps;                  /* how many of the last steps took more than one iteration */
    int slow_steps_allowed;          /* how many of those before it is fitted again */
    double past[PHI_KEPT][PHI_DIM]; /* values, the latest last */
    double weight[PHI_WINDOW][PHI_DIM][PHI_AHEAD]; /* of past values, the latest first, for the next */
} phi_history;

#endif
#if PHI_BLOCKS
/* What was learnt about blocks of steps. For speed only. */
typedef struct {
    double evaluations_per_stage;      /* that single steps take */
    int single_steps;                  /* to make before a block is tried */
    int last_single_steps;             /* the same after the last failure, halved with every block that succeeds */
    int use_recurrences;               /* whether blocks are guessed by recurrences */
    int passes_without_recurrences;    /* that the last block took which was guessed by Runge-Kutta steps */
    size_t steps_without_recurrences;  /* to wait before recurrences are tried again */
    size_t recurrences_from_step;      /* when that is */
} phi_learnt;

#endif
/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
#include "state_members.h"
} phi_solver;
size_t phi_solver_size(void); /* for bindings to other languages, as what follows */
size_t phi_solver_steps_done(const phi_solver *s);
#if PHI_MONITOR
double phi_solver_time(const phi_solver *s);
#endif
#if PHI_ATTITUDE && PHI_POSITION
void phi_attitude(const phi_solver *s, double out[PHI_ELEMENT]); /* and the position behind it */
#elif PHI_ATTITUDE
void phi_attitude(const phi_solver *s, double out[PHI_ELEMENT]);
#endif
#if PHI_ADJOINT
size_t phi_trail_size(void);
#if PHI_EACH
size_t phi_trail_size_each(void);
#endif
#endif

/* Start at x0. params may be NULL for the defaults. PHI_BAD_ARGUMENT, and *s as before, if x0, a parameter or what
   follows from parameters alone is not finite, or one not positive that has to be. */
#if PHI_MONITOR
/* Also if phi_monitor is not positive at x0. */
#endif
phi_status phi_init(phi_solver *s, const phi_params *params, const double x0[PHI_DIM]);

#if PHI_TIMED
/* The same at the time t0, which phi_init takes to be 0. */
phi_status phi_init_at(phi_solver *s, const phi_params *params, const double x0[PHI_DIM], double t0);

#endif
#if PHI_NOISE
/* Which random numbers the next steps take: they are a function of the seed, the member and the number of the step,
   and of nothing else. phi_init begins with 0, 0, 0. Each increment of the noise is normal with variance |h|, cut off at
   PHI_BOUND sqrt(|h|). */
phi_status phi_set_noise(phi_solver *s, uint64_t seed, uint32_t member, uint64_t step);

#endif
#if PHI_ATTITUDE
/* The attitude, from now on. phi_init begins with the identity. */
#if PHI_MATRICES
/* PHI_BAD_ARGUMENT where an entry is not finite. */
#else
/* Of any length but 0. PHI_BAD_ARGUMENT where it is not finite, or 0. */
#endif
#if PHI_POSITION
/* The position may be NULL for the origin. */
#endif
phi_status phi_set_attitude(phi_solver *s, const double attitude[PHI_ATTITUDE_SIZE] PHI_AND_POSITION(const double position[3]));

#endif
#if PHI_MONITOR
/* Start at x0 with an e of one's own: the step is an exact Poisson map for each fixed e. */
#elif PHI_GAUGE
/* Start at x0 with a gauge of one's own: the step is an exact Poisson map for each fixed gauge. */
#endif
#if PHI_GAUGE
phi_status phi_init_gauge(phi_solver *s, const phi_params *params, const double x0[PHI_DIM],
    const double gauge[PHI_GAUGES]);

#endif
#if PHI_MONITOR
/* One step of size h in tau, of either sign, or many; s->t gains the physical time that they take. On failure s->x is
   the last good state, after s->steps steps. */
#else
/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
#endif
phi_status phi_step(phi_solver *s, double h);
phi_status phi_integrate(phi_solver *s, double h, size_t steps);

#if PHI_KICKED
/* Between steps: stand at x, or move by change, all else being as it was, also on PHI_BAD_ARGUMENT. Either may leave the
   leaf. */
#if PHI_MONITOR
/* But e becomes -H there, where phi_monitor must be positive. */
#endif
phi_status phi_set_state(phi_solver *s, const double x[PHI_DIM]);
phi_status phi_kick(phi_solver *s, const double change[PHI_DIM]);

#endif
#if PHI_NOISE
/* The same with increments of one's own, dw[k * PHI_DRAWS + i] that of source i in step k; NULL for random ones. */
phi_status phi_integrate_along(phi_solver *s, double h, size_t steps, const double *dw);

#endif
#if PHI_ENSEMBLE
/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good state.
   status (or NULL) receives the status of each; the first that is not OK is returned. */
#if PHI_GROUPS || PHI_PACKS
/* Members are integrated side by side in groups; with OpenMP, groups in parallel. */
#endif
phi_status phi_ensemble(const phi_params *params, double *x, size_t members, double h, size_t steps,
    unsigned char *status);

#if PHI_NOISE
/* The same where member m takes the random numbers of first_member + m, from those of first_step on; these and the seed
   are 0 for phi_ensemble. With OpenMP, members in parallel: the results do not depend on threads. */
phi_status phi_ensemble_of(const phi_params *params, double *x, size_t members PHI_AND_T0, double h, size_t steps,
    uint64_t seed, uint32_t first_member, uint64_t first_step, unsigned char *status);

#endif
#if PHI_TIMED
/* The same from the time t0 of all members on, which phi_ensemble takes to be 0. */
phi_status phi_ensemble_at(const phi_params *params, double *x, size_t members, double t0, double h, size_t steps,
    unsigned char *status);

#endif
#if PHI_EACH
#if PHI_TIMED
/* The same where each member has its own parameters params[m], time t0[m] and step h[m]; params may be NULL. */
#elif PHI_MONITOR
/* The same where each member has its own parameters params[m], e = gauge[m] and step h[m]; params and gauge may be
   NULL. */
#elif PHI_GAUGE
/* The same where each member has its own parameters params[m], gauge &gauge[m * PHI_GAUGES] and step h[m]; params and
   gauge may be NULL. */
#else
/* The same where each member has its own parameters params[m] and step h[m]; params may be NULL. */
#endif
/* frames (or NULL) receives the states after every stride-th step: frames[(k * PHI_DIM + i) * members + m] is coordinate
   i of member m after (k + 1) * stride steps, NaN if it failed before. Arrays must not overlap. */
#if PHI_TIMED
phi_status phi_ensemble_each(const phi_params *params, double *x, size_t members, const double *t0, const double *h,
    size_t steps, size_t stride, double *frames, unsigned char *status);
#elif PHI_GAUGE
phi_status phi_ensemble_each(const phi_params *params, double *x, size_t members, const double *gauge,
    const double *h, size_t steps, size_t stride, double *frames, unsigned char *status);
#else
phi_status phi_ensemble_each(const phi_params *params, double *x, size_t members, const double *h, size_t steps,
    size_t stride, double *frames, unsigned char *status);
#endif

#endif
#if PHI_ATTITUDES
/* Many members with attitudes, in place, each by itself as phi_integrate makes it; with OpenMP, members in parallel:
   x[i * members + m] is coordinate i of member m, attitude[i * members + m] number i of its attitude in the order of
   phi_attitude, at its start, then at its end. What differs from member to member is given as for a single one, params may be NULL for
   the defaults. frames and attitudes (or NULL) receive what x and attitude are after every stride-th step, those after
   (k + 1) * stride steps as row k, NaN where a member failed before. Arrays must not overlap. */
phi_status phi_ensemble_attitudes(const phi_params *params, double *x, double *attitude, size_t members,
    PHI_OWN_POINTER
    const double *h, size_t steps,
    PHI_RANDOM_NUMBERS
    size_t stride, double *frames, double *attitudes, unsigned char *status);

#endif

#endif
#if PHI_TANGENT
#if PHI_MONITOR
/* One step as phi_step makes it, and its derivative: tangent[i * PHI_DIM + j] is that of the new x_i along the old x_j,
   to round-off, with e held fixed. On failure both are as before. */
#else
/* One step as phi_step makes it, and its derivative: tangent[i * PHI_DIM + j] is that of the new x_i along the old x_j,
   to round-off, with any gauge held fixed. On failure both are as before. */
#endif
phi_status phi_step_tangent(phi_solver *s, double h, double tangent[PHI_DIM * PHI_DIM]);

#endif
#if PHI_ADJOINT
/* One step as phi_step makes it, and the transpose of its derivative: of sum x1_bar[i] * x[i], with the new x, x0_bar gets
   the derivatives along the old x, and *params_bar gains those along the parameters; it may be NULL. Both are exact to
   round-off; what a trajectory holds fixed is held fixed. x0_bar may be x1_bar. On failure all is as before. */
phi_status phi_step_adjoint(phi_solver *s, double h, const double x1_bar[PHI_DIM], double x0_bar[PHI_DIM],
    phi_params *params_bar);

/* Many steps as phi_integrate makes them, and the transpose: rows[r * PHI_DIM + i], if not NULL, gets x_i after stride,
   2 * stride, ... steps and at the end, rows_bar are their cotangents; x0_bar and params_bar as above. With stride =
   steps there is one row. trail is room for PHI_TRAIL numbers for each step, which tell the way back. */
#if PHI_MONITOR
/* *e_bar, if not NULL, gains the derivative along e, which phi_level_bar pulls back to the start of the trajectory: where
   phi_init has set e = -H(x0), x0_bar and *params_bar gain what that adds. */
phi_status phi_pullback(phi_solver *s, double h, size_t steps, size_t stride, double *rows, const double *rows_bar,
    double x0_bar[PHI_DIM], phi_params *params_bar, double *e_bar, double *trail);
void phi_level_bar(const phi_params *params, const double x0[PHI_DIM], double e_bar, double x0_bar[PHI_DIM],
    phi_params *params_bar);
#else
phi_status phi_pullback(phi_solver *s, double h, size_t steps, size_t stride, double *rows, const double *rows_bar,
    double x0_bar[PHI_DIM], phi_params *params_bar, double *trail);
#endif

#if PHI_EACH
/* phi_pullback for members, of which member m begins at x0 + m * PHI_DIM, with params[m] and h[m]; params may be NULL for
   the defaults. rows and rows_bar have all rows of the first member, then those of the next, and so on; x0_bar is laid out
   as x0, and params_bar[m] gains what is its own. trail is room for PHI_TRAIL_EACH numbers for each step, whatever the
   number of members; status (or NULL) receives a status for each. Threads may share members out, each with a trail; that
   changes no bit where shares begin at multiples of 32. The first status that is not OK. */
phi_status phi_pullback_each(const phi_params *params, const double *x0, size_t members, PHI_OWN_POINTER const double *h,
    size_t steps, size_t stride, double *rows, const double *rows_bar, double *x0_bar, phi_params *params_bar,
    double *trail, unsigned char *status);

#endif
#endif
#endif
