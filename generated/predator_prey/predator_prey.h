/*
 * The declarations of predator_prey.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: b5f422a3866079d3a5304977fbbdef179931144f4f2214bf2c5a7ba4eac4ccd3
 */
#ifndef PREDATOR_PREY_H
#define PREDATOR_PREY_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define predator_prey_DIM 2 /* coordinates: prey, predator */
#define predator_prey_ORDER 4
#define predator_prey_CASIMIRS 0
#define predator_prey_PHIGEN_VERSION "0.1.0"
#define predator_prey_SPEC_SHA256 "e9ed620ed8f3d5aad12a62fc9348c8e9ca6a49af75e51b9b9dab791a7ff33715"
enum { predator_prey_COEFFICIENTS = 11 }; /* numbers that depend on params and h only */
enum { predator_prey_DIFFERENCES = 9 };   /* that a step is extrapolated from: more amplify rounding */

typedef struct {
    double growth; /* growth rate of the prey without predators */
    double attack; /* prey lost per predator and unit time */
    double gain;   /* predators born per prey and unit time */
    double death;  /* death rate of the predators without prey */
} predator_prey_params;
extern const predator_prey_params predator_prey_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double predator_prey_hamiltonian(const predator_prey_params *params, const double x[2]);
void predator_prey_casimirs(const predator_prey_params *params, const double x[2], double out[]);
void predator_prey_vector_field(const predator_prey_params *params, const double x[2], double out[2]);

typedef enum { predator_prey_OK = 0, predator_prey_NO_CONVERGENCE, predator_prey_SINGULAR,
    predator_prey_NOT_FINITE, predator_prey_BAD_ARGUMENT } predator_prey_status;
const char *predator_prey_status_string(predator_prey_status status);

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[predator_prey_DIFFERENCES][predator_prey_DIM];
} predator_prey_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[predator_prey_DIM];     /* the state; read it freely, change it only through functions */
    double carry[predator_prey_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                    /* good steps since predator_prey_init */
    size_t evaluations;              /* of the generating function, for statistics */
    double t;                        /* time since predator_prey_init */
    double h;                        /* the last step size; NaN before the first step */
    predator_prey_params params;
    double coef[predator_prey_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    predator_prey_history history; /* for starting guesses */
} predator_prey_solver;
size_t predator_prey_solver_size(void); /* for bindings to other languages, as what follows */
size_t predator_prey_solver_steps_done(const predator_prey_solver *s);

/* Start at x0. params may be NULL for the defaults. predator_prey_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
predator_prey_status predator_prey_init(predator_prey_solver *s, const predator_prey_params *params,
    const double x0[predator_prey_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
predator_prey_status predator_prey_step(predator_prey_solver *s, double h);
predator_prey_status predator_prey_integrate(predator_prey_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on predator_prey_BAD_ARGUMENT.
   Either may leave the leaf. */
predator_prey_status predator_prey_set_state(predator_prey_solver *s, const double x[predator_prey_DIM]);
predator_prey_status predator_prey_kick(predator_prey_solver *s, const double change[predator_prey_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
predator_prey_status predator_prey_ensemble(const predator_prey_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* PREDATOR_PREY_H */
