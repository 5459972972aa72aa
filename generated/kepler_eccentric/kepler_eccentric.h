/*
 * The declarations of kepler_eccentric.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: e5bb2fa0399b4d3a1d223a58a1125bdd2a76a6e13f063d70080ba71d148ed6a2
 */
#ifndef KEPLER_ECCENTRIC_H
#define KEPLER_ECCENTRIC_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define kepler_eccentric_DIM 4 /* coordinates: q1, q2, p1, p2 */
#define kepler_eccentric_ORDER 8
#define kepler_eccentric_CASIMIRS 0
#define kepler_eccentric_PHIGEN_VERSION "0.1.0"
#define kepler_eccentric_SPEC_SHA256 "81869181189ef5b2007d1f8ba4054229e16bdbb9b83bebe02d636128ec39e8aa"
enum { kepler_eccentric_COEFFICIENTS = 140 }; /* numbers that depend on params and h only */
enum { kepler_eccentric_GAUGES = 1 };         /* that a trajectory holds fixed: e */

typedef struct {
    double oblateness; /* quadrupole of the planet */
} kepler_eccentric_params;
extern const kepler_eccentric_params kepler_eccentric_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double kepler_eccentric_hamiltonian(const kepler_eccentric_params *params, const double x[4]);
void kepler_eccentric_casimirs(const kepler_eccentric_params *params, const double x[4], double out[]);
void kepler_eccentric_vector_field(const kepler_eccentric_params *params, const double x[4], double out[4]);

/* dt/dtau at x; params may be NULL. */
double kepler_eccentric_monitor(const kepler_eccentric_params *params, const double x[4]);

typedef enum { kepler_eccentric_OK = 0, kepler_eccentric_NO_CONVERGENCE, kepler_eccentric_SINGULAR,
    kepler_eccentric_NOT_FINITE, kepler_eccentric_BAD_ARGUMENT } kepler_eccentric_status;
const char *kepler_eccentric_status_string(kepler_eccentric_status status);

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[kepler_eccentric_DIM];     /* the state; read it freely, change it only through functions */
    double carry[kepler_eccentric_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                       /* good steps since kepler_eccentric_init */
    size_t evaluations;                 /* of the generating function, for statistics */
    /* physical time since kepler_eccentric_init, t + t_carry: steps are equal in tau, not in it */
    double t, t_carry;
    double h; /* the last step size; NaN before the first step */
    kepler_eccentric_params params;
    double gauge[kepler_eccentric_GAUGES]; /* e = -H(x0): K = monitor (H + e) is 0 along the trajectory */
    double coef[kepler_eccentric_COEFFICIENTS]; /* all that depends on params and h only */
} kepler_eccentric_solver;
size_t kepler_eccentric_solver_size(void); /* for bindings to other languages, as what follows */
size_t kepler_eccentric_solver_steps_done(const kepler_eccentric_solver *s);
double kepler_eccentric_solver_time(const kepler_eccentric_solver *s);

/* Start at x0. params may be NULL for the defaults. kepler_eccentric_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
/* Also if kepler_eccentric_monitor is not positive at x0. */
kepler_eccentric_status kepler_eccentric_init(kepler_eccentric_solver *s,
    const kepler_eccentric_params *params, const double x0[kepler_eccentric_DIM]);

/* Start at x0 with an e of one's own: the step is an exact Poisson map for each fixed e. */
kepler_eccentric_status kepler_eccentric_init_gauge(kepler_eccentric_solver *s,
    const kepler_eccentric_params *params, const double x0[kepler_eccentric_DIM],
    const double gauge[kepler_eccentric_GAUGES]);

/* One step of size h in tau, of either sign, or many; s->t gains the physical time that they take. On failure
   s->x is the last good state, after s->steps steps. */
kepler_eccentric_status kepler_eccentric_step(kepler_eccentric_solver *s, double h);
kepler_eccentric_status kepler_eccentric_integrate(kepler_eccentric_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   kepler_eccentric_BAD_ARGUMENT. Either may leave the leaf. */
/* But e becomes -H there, where kepler_eccentric_monitor must be positive. */
kepler_eccentric_status kepler_eccentric_set_state(kepler_eccentric_solver *s,
    const double x[kepler_eccentric_DIM]);
kepler_eccentric_status kepler_eccentric_kick(kepler_eccentric_solver *s,
    const double change[kepler_eccentric_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
kepler_eccentric_status kepler_eccentric_ensemble(const kepler_eccentric_params *params, double *x,
    size_t members, double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* KEPLER_ECCENTRIC_H */
