/*
 * The declarations of kepler_eccentric.c. DO NOT EDIT: phigen detects changes by the checksum below.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 8029452828a2dbdb99e611970a55c8c235236a63b48912039bac5923d8b9ade4
 */
#ifndef KEPLER_ECCENTRIC_H
#define KEPLER_ECCENTRIC_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define kepler_eccentric_DIM 4      /* coordinates: q1, q2, p1, p2 */
#define kepler_eccentric_ORDER 8    /* order of the method */
#define kepler_eccentric_CASIMIRS 0 /* Casimirs: none */
#define kepler_eccentric_PHIGEN_VERSION "0.1.0"
#define kepler_eccentric_SPEC_SHA256 "9f8cc7f788b5fd46c22be5f35d1f064d371462a0b9c6814a9326d129431a0702"
enum { kepler_eccentric_COEFFICIENTS = 140 }; /* number of coefficients: functions of params and h */
enum { kepler_eccentric_GAUGES = 1 };         /* number of entries of gauge: only the energy level e */

typedef struct {
    double oblateness; /* quadrupole of the planet */
} kepler_eccentric_params;
extern const kepler_eccentric_params kepler_eccentric_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double kepler_eccentric_hamiltonian(const kepler_eccentric_params *params, const double x[4]);
void kepler_eccentric_casimirs(const kepler_eccentric_params *params, const double x[4], double out[]);
void kepler_eccentric_vector_field(const kepler_eccentric_params *params, const double x[4], double out[4]);

/* The monitor dt/dtau at x, the physical time per unit of tau. params may be NULL. */
double kepler_eccentric_monitor(const kepler_eccentric_params *params, const double x[4]);

typedef enum { kepler_eccentric_OK = 0, kepler_eccentric_NO_CONVERGENCE, kepler_eccentric_SINGULAR,
    kepler_eccentric_NOT_FINITE, kepler_eccentric_BAD_ARGUMENT } kepler_eccentric_status;
const char *kepler_eccentric_status_string(kepler_eccentric_status status); /* the meaning of a status */

/* A copy of this struct is an independent solver. Arguments of functions may point into it, or overlap. */
typedef struct {
    double x[kepler_eccentric_DIM];     /* the state; change it only by the functions below */
    double carry[kepler_eccentric_DIM]; /* rounding error of x: x + carry is more accurate */
    size_t steps;                       /* number of successful steps since kepler_eccentric_init */
    size_t evaluations;                 /* number of computed steps, for statistics */
    /* t + t_carry is the physical time since kepler_eccentric_init; steps are equal in tau */
    double t, t_carry;
    double h;                       /* size of the last step; NaN before the first step */
    kepler_eccentric_params params; /* the parameters, set by kepler_eccentric_init; do not change them */
    /* the energy level e: -H(x0), or the value passed to kepler_eccentric_init_gauge */
    double gauge[kepler_eccentric_GAUGES];
    double coef[kepler_eccentric_COEFFICIENTS]; /* functions of params and h, computed when h changes */
} kepler_eccentric_solver;
size_t kepler_eccentric_solver_size(void); /* in bytes, for languages that cannot read the struct */
size_t kepler_eccentric_solver_steps_done(const kepler_eccentric_solver *s);
double kepler_eccentric_solver_time(const kepler_eccentric_solver *s);

/* Initialise *s with the state x0; params = NULL for the defaults. Returns kepler_eccentric_BAD_ARGUMENT,
   with *s unchanged, if a value or coefficient is not finite, or a parameter that must be positive is not. */
/* kepler_eccentric_init also returns kepler_eccentric_BAD_ARGUMENT if kepler_eccentric_monitor is not
   positive at x0. */
kepler_eccentric_status kepler_eccentric_init(kepler_eccentric_solver *s,
    const kepler_eccentric_params *params, const double x0[kepler_eccentric_DIM]);

/* As kepler_eccentric_init, with the energy level e = gauge[0] in place of -H(x0). Steps of the same
   size with the same e are the same map of states. */
kepler_eccentric_status kepler_eccentric_init_gauge(kepler_eccentric_solver *s,
    const kepler_eccentric_params *params, const double x0[kepler_eccentric_DIM],
    const double gauge[kepler_eccentric_GAUGES]);

/* Make one step or many. Their size h in tau may be negative; s->t increases by their physical time. If a
   step fails, s->x and s->steps remain those before this step. */
kepler_eccentric_status kepler_eccentric_step(kepler_eccentric_solver *s, double h);
kepler_eccentric_status kepler_eccentric_integrate(kepler_eccentric_solver *s, double h, size_t steps);

/* Between steps: replace the state by x, or add `change` to the state. The values of Casimirs may change.
   Returns kepler_eccentric_BAD_ARGUMENT, with *s unchanged, if the new state is not finite. */
/* The energy level e becomes -H of the new state, at which kepler_eccentric_monitor must be positive. */
kepler_eccentric_status kepler_eccentric_set_state(kepler_eccentric_solver *s,
    const double x[kepler_eccentric_DIM]);
kepler_eccentric_status kepler_eccentric_kick(kepler_eccentric_solver *s,
    const double change[kepler_eccentric_DIM]);

/* Integrate members in place: x[i * members + m] is coordinate i of member m. Failed members get their last
   good state. status[m] is for member m; `status` may be NULL. Returns the first status that is not OK. */
kepler_eccentric_status kepler_eccentric_ensemble(const kepler_eccentric_params *params, double *x,
    size_t members, double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* KEPLER_ECCENTRIC_H */
