/*
 * The declarations of charged_particle.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 5e59cc723f3597b6ad990e7c76f20ce8d7d53f0b3c1c0ec02c719870bb020547
 */
#ifndef CHARGED_PARTICLE_H
#define CHARGED_PARTICLE_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define charged_particle_DIM 6 /* coordinates: x, y, z, u, v, w */
#define charged_particle_ORDER 4
#define charged_particle_CASIMIRS 0
#define charged_particle_PHIGEN_VERSION "0.1.0"
#define charged_particle_SPEC_SHA256 "6bda6268e8c6b32b81eb7049d472c6dd6ed8376176c222eb700c90680204f278"
enum { charged_particle_COEFFICIENTS = 14 }; /* numbers that depend on params and h only */

typedef struct {
    char unused; /* this system has no parameters */
} charged_particle_params;
extern const charged_particle_params charged_particle_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double charged_particle_hamiltonian(const charged_particle_params *params, const double x[6]);
void charged_particle_casimirs(const charged_particle_params *params, const double x[6], double out[]);
void charged_particle_vector_field(const charged_particle_params *params, const double x[6], double out[6]);

typedef enum { charged_particle_OK = 0, charged_particle_NO_CONVERGENCE, charged_particle_SINGULAR,
    charged_particle_NOT_FINITE, charged_particle_BAD_ARGUMENT } charged_particle_status;
const char *charged_particle_status_string(charged_particle_status status);

enum { charged_particle_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[charged_particle_DIFFERENCES][charged_particle_DIM];
} charged_particle_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[charged_particle_DIM];     /* the state; read it freely, change it only through functions */
    double carry[charged_particle_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                       /* good steps since charged_particle_init */
    size_t evaluations;                 /* of the generating function, for statistics */
    double t;                           /* time since charged_particle_init */
    double h;                           /* the last step size; NaN before the first step */
    charged_particle_params params;
    double coef[charged_particle_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    charged_particle_history history; /* for starting guesses */
} charged_particle_solver;
size_t charged_particle_solver_size(void); /* for bindings to other languages, as what follows */
size_t charged_particle_solver_steps_done(const charged_particle_solver *s);

/* Start at x0. params may be NULL for the defaults. charged_particle_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
charged_particle_status charged_particle_init(charged_particle_solver *s,
    const charged_particle_params *params, const double x0[charged_particle_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
charged_particle_status charged_particle_step(charged_particle_solver *s, double h);
charged_particle_status charged_particle_integrate(charged_particle_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on
   charged_particle_BAD_ARGUMENT. Either may leave the leaf. */
charged_particle_status charged_particle_set_state(charged_particle_solver *s,
    const double x[charged_particle_DIM]);
charged_particle_status charged_particle_kick(charged_particle_solver *s,
    const double change[charged_particle_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
charged_particle_status charged_particle_ensemble(const charged_particle_params *params, double *x,
    size_t members, double h, size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* CHARGED_PARTICLE_H */
