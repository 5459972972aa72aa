/*
 * The declarations of thruster_body.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 5e870812c713fd2073c927a2ea82df52bf723b080e99e1285b9c93a6e3b83924
 */
#ifndef THRUSTER_BODY_H
#define THRUSTER_BODY_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define thruster_body_DIM 3 /* coordinates: m1, m2, m3 */
#define thruster_body_ORDER 4
#define thruster_body_CASIMIRS 1 /* C */
#define thruster_body_PHIGEN_VERSION "0.1.0"
#define thruster_body_SPEC_SHA256 "d7008fc5692e1b59f1c3b14bb2c026902f9cbe75a2384109edc23562163c7f67"
enum { thruster_body_STAGES = 5 };       /* of a step */
enum { thruster_body_COEFFICIENTS = 8 }; /* numbers that depend on params and h only */

typedef struct {
    double I1;     /* default 2.0 */
    double I2;     /* default 3.0 */
    double I3;     /* default 4.0 */
    double torque; /* about the third axis */
    double drag;   /* default 0.05 */
} thruster_body_params;
extern const thruster_body_params thruster_body_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) (grad H(x) + zeta(x)) + f(x). params may be
   NULL. */
double thruster_body_hamiltonian(const thruster_body_params *params, const double x[3]);
void thruster_body_casimirs(const thruster_body_params *params, const double x[3], double out[]);
void thruster_body_vector_field(const thruster_body_params *params, const double x[3], double out[3]);

typedef enum { thruster_body_OK = 0, thruster_body_NO_CONVERGENCE, thruster_body_SINGULAR,
    thruster_body_NOT_FINITE, thruster_body_BAD_ARGUMENT } thruster_body_status;
const char *thruster_body_status_string(thruster_body_status status);

enum { thruster_body_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[thruster_body_DIFFERENCES][thruster_body_DIM];
} thruster_body_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[thruster_body_DIM];     /* the state; read it freely, change it only through functions */
    double carry[thruster_body_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                    /* good steps since thruster_body_init */
    size_t evaluations;              /* of the generating function, for statistics */
    double t;                        /* time since thruster_body_init */
    double h;                        /* the last step size; NaN before the first step */
    thruster_body_params params;
    double coef[thruster_body_STAGES][thruster_body_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    thruster_body_history history[thruster_body_STAGES]; /* for starting guesses */
} thruster_body_solver;
size_t thruster_body_solver_size(void); /* for bindings to other languages, as what follows */
size_t thruster_body_solver_steps_done(const thruster_body_solver *s);

/* Start at x0. params may be NULL for the defaults. thruster_body_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
thruster_body_status thruster_body_init(thruster_body_solver *s, const thruster_body_params *params,
    const double x0[thruster_body_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
thruster_body_status thruster_body_step(thruster_body_solver *s, double h);
thruster_body_status thruster_body_integrate(thruster_body_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on thruster_body_BAD_ARGUMENT.
   Either may leave the leaf. */
thruster_body_status thruster_body_set_state(thruster_body_solver *s, const double x[thruster_body_DIM]);
thruster_body_status thruster_body_kick(thruster_body_solver *s, const double change[thruster_body_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
thruster_body_status thruster_body_ensemble(const thruster_body_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* THRUSTER_BODY_H */
