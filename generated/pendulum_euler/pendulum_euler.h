/*
 * The declarations of pendulum_euler.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 94521e11351130014158a9e2127b102657817b3ec0fe9a7142996c276bf16bbf
 */
#ifndef PENDULUM_EULER_H
#define PENDULUM_EULER_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define pendulum_euler_DIM 2 /* coordinates: q, p */
#define pendulum_euler_ORDER 1
#define pendulum_euler_CASIMIRS 0
#define pendulum_euler_PHIGEN_VERSION "0.1.0"
#define pendulum_euler_SPEC_SHA256 "10030022f93bccf90322e3b69b8a94dcdf9ef8ba03d95b772ef2b3dc4481dc59"
enum { pendulum_euler_COEFFICIENTS = 2 }; /* numbers that depend on params and h only */

typedef struct {
    double g; /* gravity over the length of the rod */
} pendulum_euler_params;
extern const pendulum_euler_params pendulum_euler_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double pendulum_euler_hamiltonian(const pendulum_euler_params *params, const double x[2]);
void pendulum_euler_casimirs(const pendulum_euler_params *params, const double x[2], double out[]);
void pendulum_euler_vector_field(const pendulum_euler_params *params, const double x[2], double out[2]);

typedef enum { pendulum_euler_OK = 0, pendulum_euler_NO_CONVERGENCE, pendulum_euler_SINGULAR,
    pendulum_euler_NOT_FINITE, pendulum_euler_BAD_ARGUMENT } pendulum_euler_status;
const char *pendulum_euler_status_string(pendulum_euler_status status);

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[pendulum_euler_DIM];     /* the state; read it freely, change it only through functions */
    double carry[pendulum_euler_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                     /* good steps since pendulum_euler_init */
    size_t evaluations;               /* of the generating function, for statistics */
    double t;                         /* time since pendulum_euler_init */
    double h;                         /* the last step size; NaN before the first step */
    pendulum_euler_params params;
    double coef[pendulum_euler_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} pendulum_euler_solver;
size_t pendulum_euler_solver_size(void); /* for bindings to other languages, as what follows */
size_t pendulum_euler_solver_steps_done(const pendulum_euler_solver *s);

/* Start at x0. params may be NULL for the defaults. pendulum_euler_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
pendulum_euler_status pendulum_euler_init(pendulum_euler_solver *s, const pendulum_euler_params *params,
    const double x0[pendulum_euler_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
pendulum_euler_status pendulum_euler_step(pendulum_euler_solver *s, double h);
pendulum_euler_status pendulum_euler_integrate(pendulum_euler_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   pendulum_euler_BAD_ARGUMENT. Either may leave the leaf. */
pendulum_euler_status pendulum_euler_set_state(pendulum_euler_solver *s, const double x[pendulum_euler_DIM]);
pendulum_euler_status pendulum_euler_kick(pendulum_euler_solver *s, const double change[pendulum_euler_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
pendulum_euler_status pendulum_euler_ensemble(const pendulum_euler_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* PENDULUM_EULER_H */
