/*
 * The declarations of guiding_centre.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 444f6be9352628b5646835acbb527327c829fa78899dd9715361f8b29d11ab94
 */
#ifndef GUIDING_CENTRE_H
#define GUIDING_CENTRE_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define guiding_centre_DIM 4 /* coordinates: x, y, z, u */
#define guiding_centre_ORDER 4
#define guiding_centre_CASIMIRS 0
#define guiding_centre_PHIGEN_VERSION "0.1.0"
#define guiding_centre_SPEC_SHA256 "2fe2b1310137da070ce71887dcad93562dc0dd719fad890ce1b776e6af4b1570"
enum { guiding_centre_STAGES = 5 };       /* of a step */
enum { guiding_centre_COEFFICIENTS = 5 }; /* numbers that depend on params and h only */
enum { guiding_centre_DIFFERENCES = 9 };  /* that a step is extrapolated from: more amplify rounding */

typedef struct {
    double kappa; /* twist of the field lines per unit of length */
    double mu;    /* magnetic moment */
    double k;     /* stiffness of the electric potential */
} guiding_centre_params;
extern const guiding_centre_params guiding_centre_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double guiding_centre_hamiltonian(const guiding_centre_params *params, const double x[4]);
void guiding_centre_casimirs(const guiding_centre_params *params, const double x[4], double out[]);
void guiding_centre_vector_field(const guiding_centre_params *params, const double x[4], double out[4]);

typedef enum { guiding_centre_OK = 0, guiding_centre_NO_CONVERGENCE, guiding_centre_SINGULAR,
    guiding_centre_NOT_FINITE, guiding_centre_BAD_ARGUMENT } guiding_centre_status;
const char *guiding_centre_status_string(guiding_centre_status status);

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[guiding_centre_DIFFERENCES][guiding_centre_DIM];
} guiding_centre_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[guiding_centre_DIM];     /* the state; read it freely, change it only through functions */
    double carry[guiding_centre_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                     /* good steps since guiding_centre_init */
    size_t evaluations;               /* of the generating function, for statistics */
    double t;                         /* time since guiding_centre_init */
    double h;                         /* the last step size; NaN before the first step */
    guiding_centre_params params;
    /* all that depends on params and h only */
    double coef[guiding_centre_STAGES][guiding_centre_COEFFICIENTS];
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    guiding_centre_history history[guiding_centre_STAGES]; /* for starting guesses */
} guiding_centre_solver;
size_t guiding_centre_solver_size(void); /* for bindings to other languages, as what follows */
size_t guiding_centre_solver_steps_done(const guiding_centre_solver *s);

/* Start at x0. params may be NULL for the defaults. guiding_centre_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
guiding_centre_status guiding_centre_init(guiding_centre_solver *s, const guiding_centre_params *params,
    const double x0[guiding_centre_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
guiding_centre_status guiding_centre_step(guiding_centre_solver *s, double h);
guiding_centre_status guiding_centre_integrate(guiding_centre_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   guiding_centre_BAD_ARGUMENT. Either may leave the leaf. */
guiding_centre_status guiding_centre_set_state(guiding_centre_solver *s, const double x[guiding_centre_DIM]);
guiding_centre_status guiding_centre_kick(guiding_centre_solver *s, const double change[guiding_centre_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
guiding_centre_status guiding_centre_ensemble(const guiding_centre_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* GUIDING_CENTRE_H */
