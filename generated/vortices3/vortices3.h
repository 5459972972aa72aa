/*
 * The declarations of vortices3.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 6a34140e4a452bdf343f2fe6c24d2e586229b032a2e3e40a329622d4617ccfe1
 */
#ifndef VORTICES3_H
#define VORTICES3_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define vortices3_DIM 6 /* coordinates: x1, y1, x2, y2, x3, y3 */
#define vortices3_ORDER 4
#define vortices3_CASIMIRS 0
#define vortices3_PHIGEN_VERSION "0.1.0"
#define vortices3_SPEC_SHA256 "037a04eba07f271265722e4dcbf9a974884f1b57a9cde7f8c30f2ddfde0882bc"
enum { vortices3_COEFFICIENTS = 3 }; /* numbers that depend on params and h only */

typedef struct {
    char unused; /* this system has no parameters */
} vortices3_params;
extern const vortices3_params vortices3_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double vortices3_hamiltonian(const vortices3_params *params, const double x[6]);
void vortices3_casimirs(const vortices3_params *params, const double x[6], double out[]);
void vortices3_vector_field(const vortices3_params *params, const double x[6], double out[6]);

typedef enum { vortices3_OK = 0, vortices3_NO_CONVERGENCE, vortices3_SINGULAR, vortices3_NOT_FINITE,
    vortices3_BAD_ARGUMENT } vortices3_status;
const char *vortices3_status_string(vortices3_status status);

enum { vortices3_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[vortices3_DIFFERENCES][vortices3_DIM];
} vortices3_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[vortices3_DIM];     /* the state; read it freely, change it only through functions */
    double carry[vortices3_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                /* good steps since vortices3_init */
    size_t evaluations;          /* of the generating function, for statistics */
    double t;                    /* time since vortices3_init */
    double h;                    /* the last step size; NaN before the first step */
    vortices3_params params;
    double coef[vortices3_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    vortices3_history history; /* for starting guesses */
} vortices3_solver;
size_t vortices3_solver_size(void); /* for bindings to other languages, as what follows */
size_t vortices3_solver_steps_done(const vortices3_solver *s);

/* Start at x0. params may be NULL for the defaults. vortices3_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
vortices3_status vortices3_init(vortices3_solver *s, const vortices3_params *params,
    const double x0[vortices3_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
vortices3_status vortices3_step(vortices3_solver *s, double h);
vortices3_status vortices3_integrate(vortices3_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on vortices3_BAD_ARGUMENT.
   Either may leave the leaf. */
vortices3_status vortices3_set_state(vortices3_solver *s, const double x[vortices3_DIM]);
vortices3_status vortices3_kick(vortices3_solver *s, const double change[vortices3_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
vortices3_status vortices3_ensemble(const vortices3_params *params, double *x, size_t members, double h,
    size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* VORTICES3_H */
