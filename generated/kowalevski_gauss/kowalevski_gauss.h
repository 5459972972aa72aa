/*
 * The declarations of kowalevski_gauss.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 470848111f126edf505752a03d7d7a79568f360123aeafc717e7be051b5af3a7
 */
#ifndef KOWALEVSKI_GAUSS_H
#define KOWALEVSKI_GAUSS_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define kowalevski_gauss_DIM 6 /* coordinates: P1, P2, P3, G1, G2, G3 */
#define kowalevski_gauss_ORDER 16
#define kowalevski_gauss_CASIMIRS 2 /* A, B */
#define kowalevski_gauss_PHIGEN_VERSION "0.1.0"
#define kowalevski_gauss_SPEC_SHA256 "9ee174aea24a8dd9f18ca57c6b7a1c30e626c7f36ae052fb435a963c93ab1f80"
enum { kowalevski_gauss_COEFFICIENTS = 1 }; /* numbers that depend on params and h only */
enum { kowalevski_gauss_NODES = 8 };        /* stages of a step */
enum { kowalevski_gauss_WIDTH = 8 };        /* of an array over the stages */
enum { kowalevski_gauss_UNKNOWNS = 8 };     /* of a stage */

typedef struct {
    char unused; /* this system has no parameters */
} kowalevski_gauss_params;
extern const kowalevski_gauss_params kowalevski_gauss_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double kowalevski_gauss_hamiltonian(const kowalevski_gauss_params *params, const double x[6]);
void kowalevski_gauss_casimirs(const kowalevski_gauss_params *params, const double x[6], double out[]);
void kowalevski_gauss_vector_field(const kowalevski_gauss_params *params, const double x[6], double out[6]);

typedef enum { kowalevski_gauss_OK = 0, kowalevski_gauss_NO_CONVERGENCE, kowalevski_gauss_SINGULAR,
    kowalevski_gauss_NOT_FINITE, kowalevski_gauss_BAD_ARGUMENT } kowalevski_gauss_status;
const char *kowalevski_gauss_status_string(kowalevski_gauss_status status);

/* What the last step tells of the next one. For speed only. */
typedef struct {
    int count;   /* 0 before the first step */
    int sweeps;  /* that the last step took */
    double rate; /* at which changes of sweeps shrink */
    /* of the stages of the last step, in the frame of its start */
    double moves[kowalevski_gauss_UNKNOWNS][kowalevski_gauss_WIDTH];
} kowalevski_gauss_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[kowalevski_gauss_DIM];     /* the state; read it freely, change it only through functions */
    double carry[kowalevski_gauss_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                       /* good steps since kowalevski_gauss_init */
    size_t evaluations;                 /* sweeps over the stages, for statistics */
    double t;                           /* time since kowalevski_gauss_init */
    double h;                           /* the last step size; NaN before the first step */
    kowalevski_gauss_params params;
    double coef[kowalevski_gauss_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    kowalevski_gauss_history history; /* for starting guesses */
} kowalevski_gauss_solver;
size_t kowalevski_gauss_solver_size(void); /* for bindings to other languages, as what follows */
size_t kowalevski_gauss_solver_steps_done(const kowalevski_gauss_solver *s);

/* Start at x0. params may be NULL for the defaults. kowalevski_gauss_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
kowalevski_gauss_status kowalevski_gauss_init(kowalevski_gauss_solver *s,
    const kowalevski_gauss_params *params, const double x0[kowalevski_gauss_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
kowalevski_gauss_status kowalevski_gauss_step(kowalevski_gauss_solver *s, double h);
kowalevski_gauss_status kowalevski_gauss_integrate(kowalevski_gauss_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   kowalevski_gauss_BAD_ARGUMENT. Either may leave the leaf. */
kowalevski_gauss_status kowalevski_gauss_set_state(kowalevski_gauss_solver *s,
    const double x[kowalevski_gauss_DIM]);
kowalevski_gauss_status kowalevski_gauss_kick(kowalevski_gauss_solver *s,
    const double change[kowalevski_gauss_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
kowalevski_gauss_status kowalevski_gauss_ensemble(const kowalevski_gauss_params *params, double *x,
    size_t members, double h, size_t steps, unsigned char *status);

/* The same where each member has its own parameters params[m] and step h[m]; params may be NULL. */
/* frames (or NULL) receives the states after every stride-th step: frames[(k * kowalevski_gauss_DIM + i) *
   members + m] is coordinate i of member m after (k + 1) * stride steps, NaN if it failed before. Arrays must
   not overlap. */
kowalevski_gauss_status kowalevski_gauss_ensemble_each(const kowalevski_gauss_params *params, double *x,
    size_t members, const double *h, size_t steps, size_t stride, double *frames, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* KOWALEVSKI_GAUSS_H */
