/*
 * The declarations of pendulum_euler.c. DO NOT EDIT: phigen detects changes by the checksum below.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 50940600eae867b94d502449c665fed0fff36561787be34c682c95b47a854c5f
 */
#ifndef PENDULUM_EULER_H
#define PENDULUM_EULER_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define pendulum_euler_DIM 2      /* coordinates: q, p */
#define pendulum_euler_ORDER 1    /* order of the method */
#define pendulum_euler_CASIMIRS 0 /* Casimirs: none */
#define pendulum_euler_PHIGEN_VERSION "0.1.0"
#define pendulum_euler_SPEC_SHA256 "d5fee8a2d3fff23ddbddeab960102f5ac0a598b14e727457465bbf012b8b6b14"
enum { pendulum_euler_COEFFICIENTS = 2 }; /* number of coefficients: functions of params and h */

typedef struct {
    double g; /* acceleration of gravity divided by the length of the rod */
} pendulum_euler_params;
extern const pendulum_euler_params pendulum_euler_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double pendulum_euler_hamiltonian(const pendulum_euler_params *params, const double x[2]);
void pendulum_euler_casimirs(const pendulum_euler_params *params, const double x[2], double out[]);
void pendulum_euler_vector_field(const pendulum_euler_params *params, const double x[2], double out[2]);

typedef enum { pendulum_euler_OK = 0, pendulum_euler_NO_CONVERGENCE, pendulum_euler_SINGULAR,
    pendulum_euler_NOT_FINITE, pendulum_euler_BAD_ARGUMENT } pendulum_euler_status;
const char *pendulum_euler_status_string(pendulum_euler_status status); /* the meaning of a status */

/* A copy of this struct is an independent solver. Arguments of functions may point into it, or overlap. */
typedef struct {
    double x[pendulum_euler_DIM]; /* the state; change it only by the functions below */
    double carry[pendulum_euler_DIM]; /* rounding error of x: x + carry is more accurate */
    size_t steps; /* number of successful steps since pendulum_euler_init */
    size_t evaluations; /* number of computed stages, for statistics */
    double t; /* time since pendulum_euler_init */
    double h; /* size of the last step; NaN before the first step */
    pendulum_euler_params params; /* the parameters, set by pendulum_euler_init; do not change them */
    double coef[pendulum_euler_COEFFICIENTS]; /* functions of params and h, computed when h changes */
    size_t steps_before_h; /* steps and t at the last change of h: t = t_before_h + (steps since then) h */
    double t_before_h;
} pendulum_euler_solver;
size_t pendulum_euler_solver_size(void); /* in bytes, for languages that cannot read the struct */
size_t pendulum_euler_solver_steps_done(const pendulum_euler_solver *s);

/* Initialise *s with the state x0; params = NULL for the defaults. Returns pendulum_euler_BAD_ARGUMENT, with
   *s unchanged, if a value or coefficient is not finite, or a parameter that must be positive is not. */
pendulum_euler_status pendulum_euler_init(pendulum_euler_solver *s, const pendulum_euler_params *params,
    const double x0[pendulum_euler_DIM]);

/* Make steps of size h, of either sign. If a step fails, s->x and s->steps remain those before this step. */
pendulum_euler_status pendulum_euler_step(pendulum_euler_solver *s, double h);
pendulum_euler_status pendulum_euler_integrate(pendulum_euler_solver *s, double h, size_t steps);

/* Between steps: replace the state by x, or add `change` to the state. The values of Casimirs may change.
   Returns pendulum_euler_BAD_ARGUMENT, with *s unchanged, if the new state is not finite. */
pendulum_euler_status pendulum_euler_set_state(pendulum_euler_solver *s, const double x[pendulum_euler_DIM]);
pendulum_euler_status pendulum_euler_kick(pendulum_euler_solver *s, const double change[pendulum_euler_DIM]);

/* Integrate members in place: x[i * members + m] is coordinate i of member m. Failed members get their last
   good state. status[m] is for member m; `status` may be NULL. Returns the first status that is not OK. */
pendulum_euler_status pendulum_euler_ensemble(const pendulum_euler_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* PENDULUM_EULER_H */
