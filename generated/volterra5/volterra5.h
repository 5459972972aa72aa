/*
 * The declarations of volterra5.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 8996d026fd9af3ab5a0cacafc881c8286ff87a6bffaf9a5012729e07fbc7ccae
 */
#ifndef VOLTERRA5_H
#define VOLTERRA5_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define volterra5_DIM 5 /* coordinates: v1, v2, v3, v4, v5 */
#define volterra5_ORDER 4
#define volterra5_CASIMIRS 1 /* C */
#define volterra5_PHIGEN_VERSION "0.1.0"
#define volterra5_SPEC_SHA256 "dd128093b5704f6c0aeea964a546614f9b636714a89d9b639a6d0eec7b0d3270"
enum { volterra5_COEFFICIENTS = 4 }; /* numbers that depend on params and h only */

typedef struct {
    char unused; /* this system has no parameters */
} volterra5_params;
extern const volterra5_params volterra5_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double volterra5_hamiltonian(const volterra5_params *params, const double x[5]);
void volterra5_casimirs(const volterra5_params *params, const double x[5], double out[]);
void volterra5_vector_field(const volterra5_params *params, const double x[5], double out[5]);

typedef enum { volterra5_OK = 0, volterra5_NO_CONVERGENCE, volterra5_SINGULAR, volterra5_NOT_FINITE,
    volterra5_BAD_ARGUMENT } volterra5_status;
const char *volterra5_status_string(volterra5_status status);

enum { volterra5_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[volterra5_DIFFERENCES][volterra5_DIM];
} volterra5_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[volterra5_DIM];     /* the state; read it freely, change it only through functions */
    double carry[volterra5_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                /* good steps since volterra5_init */
    size_t evaluations;          /* of the generating function, for statistics */
    double t;                    /* time since volterra5_init */
    double h;                    /* the last step size; NaN before the first step */
    volterra5_params params;
    double coef[volterra5_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    volterra5_history history; /* for starting guesses */
} volterra5_solver;
size_t volterra5_solver_size(void); /* for bindings to other languages, as what follows */
size_t volterra5_solver_steps_done(const volterra5_solver *s);

/* Start at x0. params may be NULL for the defaults. volterra5_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
volterra5_status volterra5_init(volterra5_solver *s, const volterra5_params *params,
    const double x0[volterra5_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
volterra5_status volterra5_step(volterra5_solver *s, double h);
volterra5_status volterra5_integrate(volterra5_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on volterra5_BAD_ARGUMENT.
   Either may leave the leaf. */
volterra5_status volterra5_set_state(volterra5_solver *s, const double x[volterra5_DIM]);
volterra5_status volterra5_kick(volterra5_solver *s, const double change[volterra5_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
volterra5_status volterra5_ensemble(const volterra5_params *params, double *x, size_t members, double h,
    size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* VOLTERRA5_H */
