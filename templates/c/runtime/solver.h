#ifndef PHI_FILE_SOLVER_H
#define PHI_FILE_SOLVER_H
#include "declarations.h"
#include "phrases.h"
#include "status.h"
const char *phi_status_string(phi_status status); /* the meaning of a status */

#include "history_gauss.h"
#include "history_differences.h"
#include "history_recurrences.h"

#include "blocks_measurements.h"

/* A copy of this struct is an independent solver. Arguments of functions may point into it, or overlap. */
typedef struct {
#include "state_members.h"
} phi_solver;
size_t phi_solver_size(void); /* in bytes, for languages that cannot read the struct */
size_t phi_solver_steps_done(const phi_solver *s);
double phi_solver_time(const phi_solver *s);
#if PHI_POSITION
void phi_attitude(const phi_solver *s, double out[PHI_ELEMENT]); /* the attitude, then the position */
#else
void phi_attitude(const phi_solver *s, double out[PHI_ELEMENT]);
#endif
size_t phi_trail_size(void); /* PHI_TRAIL, the number of doubles */
size_t phi_trail_size_each(void); /* PHI_TRAIL_EACH, the number of doubles */

/* Initialise *s with the state x0; params = NULL for the defaults. Returns PHI_BAD_ARGUMENT, with *s unchanged, if a
   value or coefficient is not finite, or a parameter that must be positive is not. */
#if PHI_MONITOR
/* phi_init also returns PHI_BAD_ARGUMENT if phi_monitor is not positive at x0. */
#endif
phi_status phi_init(phi_solver *s, const phi_params *params, const double x0[PHI_DIM]);

/* As phi_init, at the time t0; phi_init starts at the time 0. */
phi_status phi_init_at(phi_solver *s, const phi_params *params, const double x0[PHI_DIM], double t0);

/* Select the random numbers of the next steps. They are a function of seed, ensemble member and number of the step,
   which is `step` for the next step; phi_init sets seed, member and step to 0. Each increment of the noise is normal
   with variance |h|, truncated at PHI_BOUND sqrt(|h|). */
phi_status phi_set_noise(phi_solver *s, uint64_t seed, uint32_t member, uint64_t step);

/* Set the attitude of the present state. phi_init sets the identity. */
#if PHI_MATRICES
/* Returns PHI_BAD_ARGUMENT if an entry is not finite. */
#else
/* The quaternion is normalised. Returns PHI_BAD_ARGUMENT if it is 0 or not finite. */
#endif
#if PHI_POSITION
/* position may be NULL for the origin. */
#endif
phi_status phi_set_attitude(phi_solver *s, const double attitude[PHI_ATTITUDE_SIZE] PHI_AND_POSITION(const double position[3]));

#if PHI_MONITOR
/* As phi_init, with the energy level e = gauge[0] in place of -H(x0). Steps of the same
   size with the same e are the same map of states. */
#elif PHI_GAUGE
/* As phi_init, with a given gauge: steps subtract gauge[k] times Casimir k from H. */
#endif
phi_status phi_init_gauge(phi_solver *s, const phi_params *params, const double x0[PHI_DIM],
    const double gauge[PHI_GAUGES]);

#if PHI_MONITOR
/* Make one step or many. Their size h in tau may be negative; s->t increases by their physical time. If a step fails,
   s->x and s->steps remain those before this step. */
#else
/* Make steps of size h, of either sign. If a step fails, s->x and s->steps remain those before this step. */
#endif
phi_status phi_step(phi_solver *s, double h);
phi_status phi_integrate(phi_solver *s, double h, size_t steps);

/* Between steps: replace the state by x, or add `change` to the state. The values of Casimirs may change. Returns
   PHI_BAD_ARGUMENT, with *s unchanged, if the new state is not finite. */
#if PHI_MONITOR
/* The energy level e becomes -H of the new state, at which phi_monitor must be positive. */
#endif
phi_status phi_set_state(phi_solver *s, const double x[PHI_DIM]);
phi_status phi_kick(phi_solver *s, const double change[PHI_DIM]);

/* Between steps: replace the parameters; the state is unchanged. Returns PHI_BAD_ARGUMENT, with *s unchanged, for
   parameters that phi_init refuses. */
#if PHI_MONITOR
/* The energy level e becomes -H of the present state with the new parameters. */
#elif PHI_GAUGE
/* The factors of Casimirs in s->gauge are unchanged. */
#endif
phi_status phi_set_parameters(phi_solver *s, const phi_params *params);

/* As phi_integrate, with increments of the noise from the caller: dw[k * PHI_DRAWS + i] is increment i of step k. NULL for
   random increments. */
phi_status phi_integrate_along(phi_solver *s, double h, size_t steps, const double *dw);

/* States at fractions of the last step, 0 at its start and 1 at its end, by the collocation polynomial: x[r * PHI_DIM +
   i] is x_i at fraction[r]. These states serve to find events. They are far less accurate than steps, and lie off the
   symplectic leaf by their error. For a state at an event with the accuracy of steps, make a step of size (fraction -
   1) h with a copy of *s. Returns PHI_BAD_ARGUMENT before the first step, and after a change of the state. */
phi_status phi_interpolate(const phi_solver *s, const double *fraction, size_t count, double *x);

/* Integrate members in place: x[i * members + m] is coordinate i of member m. Failed members get their last good
   state. status[m] is for member m; `status` may be NULL. Returns the first status that is not OK. */
#if PHI_GROUPS || PHI_PACKS
/* Members are integrated in SIMD batches; with OpenMP, the batches are integrated in parallel. */
#endif
phi_status phi_ensemble(const phi_params *params, double *x, size_t members, double h, size_t steps,
    unsigned char *status);

/* As phi_ensemble, with selected random numbers: member m has the random numbers of `seed` and member number
   first_member + m, from step number first_step on. phi_ensemble takes 0 for seed, first_member and first_step. With OpenMP, members are
   integrated in parallel; the results do not depend on the number of threads. */
phi_status phi_ensemble_of(const phi_params *params, double *x, size_t members PHI_AND_T0, double h, size_t steps,
    uint64_t seed, uint32_t first_member, uint64_t first_step, unsigned char *status);

/* As phi_ensemble, from the time t0 on; phi_ensemble starts at the time 0. */
phi_status phi_ensemble_at(const phi_params *params, double *x, size_t members, double t0, double h, size_t steps,
    unsigned char *status);

#if PHI_TIMED
/* As phi_ensemble, for members with parameters params[m], initial time t0[m] and step size h[m]. params may be NULL for the
   defaults. */
#elif PHI_MONITOR
/* As phi_ensemble, for members with parameters params[m], energy level gauge[m] and step size h[m]. params may be NULL for the
   defaults, gauge for -H of the initial states. */
#elif PHI_GAUGE
/* As phi_ensemble, for members with parameters params[m], step size h[m], and gauge: gauge[m * PHI_GAUGES + k] times
   Casimir k is subtracted from H. params may be NULL for the defaults, gauge for factors chosen at the
   initial states. */
#else
/* As phi_ensemble, for members with separate parameters params[m] and step sizes h[m]. params may be NULL for the defaults. */
#endif
/* `frames`, if not NULL, receives the states after every stride-th step: frames[(k * PHI_DIM + i) * members + m] is
   coordinate i of member m after (k + 1) * stride steps, NaN if the member failed before. Arrays must not overlap. */
phi_status phi_ensemble_each(const phi_params *params, double *x, size_t members, PHI_OWN_POINTER const double *h,
    size_t steps, size_t stride, double *frames, unsigned char *status);

/* Integrate an ensemble with attitudes in place. Each member gets the same bits as by phi_integrate; with OpenMP, members
   are integrated in parallel. x[i * members + m] is coordinate i of member m, and attitude[i * members + m] is number i of
   its attitude in the order of phi_attitude: at first the initial values, at the end the final ones. Other arguments have a
   value for each member; params may be NULL for the defaults. frames and attitudes, if not NULL, receive x and attitude
   after every stride-th step: row k after (k + 1) * stride steps, NaN if a member failed before. Arrays must not overlap. */
phi_status phi_ensemble_attitudes(const phi_params *params, double *x, double *attitude, size_t members,
    PHI_OWN_POINTER
    const double *h, size_t steps,
    PHI_RANDOM_NUMBERS
    size_t stride, double *frames, double *attitudes, unsigned char *status);

/* Make one step as phi_step does, and compute its derivative: tangent[i * PHI_DIM + j] is the derivative of the new x_i by
   the old x_j, with parameters and gauge fixed, exact to round-off. On failure *s and tangent are unchanged. */
phi_status phi_step_tangent(phi_solver *s, double h, double tangent[PHI_DIM * PHI_DIM]);

/* Make one step as phi_step does, and its reverse pass (vector-Jacobian product). For L = sum of x1_bar[i] * x[i] with the
   new x, x0_bar receives the derivatives of L by the old x, and the derivatives by the parameters are added to
   *params_bar, if not NULL. They are partial derivatives, exact to round-off. x0_bar may be x1_bar. On failure all arguments
   are unchanged. */
phi_status phi_step_adjoint(phi_solver *s, double h, const double x1_bar[PHI_DIM], double x0_bar[PHI_DIM],
    phi_params *params_bar);

/* Make many steps as phi_integrate does, and their reverse pass (vector-Jacobian product) for a number L. rows[r *
   PHI_DIM + i], if `rows` is not NULL, receives x_i after stride, 2 * stride, ... steps and at the end; with stride =
   steps there is one row. rows_bar are the derivatives of L by these rows. x0_bar receives the derivatives of L by the
   initial state; the derivatives of L by the parameters are added to *params_bar, if params_bar is not NULL. `trail` is
   work space for the tape: PHI_TRAIL numbers for each step. */
#if PHI_MONITOR
/* The derivative of L by the energy level e is added to *e_bar, if e_bar is not NULL. If phi_init has set e = -H(x0),
   then call phi_level_bar with this derivative: it adds the derivatives of L that act through e to x0_bar and
   *params_bar. */
#endif
phi_status phi_pullback(phi_solver *s, double h, size_t steps, size_t stride, double *rows, const double *rows_bar,
    double x0_bar[PHI_DIM], phi_params *params_bar PHI_AND_DOUBLE(e_bar), double *trail);
void phi_level_bar(const phi_params *params, const double x0[PHI_DIM], double e_bar, double x0_bar[PHI_DIM],
    phi_params *params_bar);

/* phi_pullback for an ensemble. Member m starts at x0 + m * PHI_DIM, with params[m] and h[m]; params may be NULL for
   the defaults. rows and rows_bar hold all rows of member 0, then those of member 1, and so on. x0_bar has the layout
   of x0; derivatives by the parameters of member m are added to params_bar[m]. `trail` is work space for PHI_TRAIL_EACH
   numbers for each step, for any number of members. `status`, if not NULL, receives the status of each member. Returns
   the first status that is not PHI_OK. Several threads may each call this function for a part of the members, with
   separate trails; results have the same bits if parts start at multiples of 32. */
phi_status phi_pullback_each(const phi_params *params, const double *x0, size_t members, PHI_OWN_POINTER const double *h,
    size_t steps, size_t stride, double *rows, const double *rows_bar, double *x0_bar, phi_params *params_bar,
    double *trail, unsigned char *status);
#endif
