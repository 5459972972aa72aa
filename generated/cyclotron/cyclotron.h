/*
 * The declarations of cyclotron.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 08b81ed718bbf7de75bcc4ddcce4a7ca26b9b44c71257fb79c259bdf5d797a8b
 */
#ifndef CYCLOTRON_H
#define CYCLOTRON_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define cyclotron_DIM 3 /* coordinates: u, v, b */
#define cyclotron_ORDER 4
#define cyclotron_CASIMIRS 1 /* B */
#define cyclotron_PHIGEN_VERSION "0.1.0"
#define cyclotron_SPEC_SHA256 "28619749874f2e10947903325f521330765638e5d2fdca830ed74dadbaba7614"
enum { cyclotron_COEFFICIENTS = 3 }; /* numbers that depend on params and h only */

typedef struct {
    char unused; /* this system has no parameters */
} cyclotron_params;
extern const cyclotron_params cyclotron_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) grad H(x). params may be NULL. */
double cyclotron_hamiltonian(const cyclotron_params *params, const double x[3]);
void cyclotron_casimirs(const cyclotron_params *params, const double x[3], double out[]);
void cyclotron_vector_field(const cyclotron_params *params, const double x[3], double out[3]);

typedef enum { cyclotron_OK = 0, cyclotron_NO_CONVERGENCE, cyclotron_SINGULAR, cyclotron_NOT_FINITE,
    cyclotron_BAD_ARGUMENT } cyclotron_status;
const char *cyclotron_status_string(cyclotron_status status);

enum { cyclotron_DIFFERENCES = 9 }; /* those of higher order amplify rounding more than they gain */

/* The last value of the unknown and its backward differences, for a guess at the next. */
typedef struct {
    int count, order; /* differences that are known; how many of them the extrapolation adds up */
    double difference[cyclotron_DIFFERENCES][cyclotron_DIM];
} cyclotron_history;

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[cyclotron_DIM];     /* the state; read it freely, change it only through functions */
    double carry[cyclotron_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                /* good steps since cyclotron_init */
    size_t evaluations;          /* of the generating function, for statistics */
    double t;                    /* time since cyclotron_init */
    double h;                    /* the last step size; NaN before the first step */
    cyclotron_params params;
    double coef[cyclotron_COEFFICIENTS]; /* all that depends on params and h only */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
    cyclotron_history history; /* for starting guesses */
} cyclotron_solver;
size_t cyclotron_solver_size(void); /* for bindings to other languages, as what follows */
size_t cyclotron_solver_steps_done(const cyclotron_solver *s);

/* Start at x0. params may be NULL for the defaults. cyclotron_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
cyclotron_status cyclotron_init(cyclotron_solver *s, const cyclotron_params *params,
    const double x0[cyclotron_DIM]);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
cyclotron_status cyclotron_step(cyclotron_solver *s, double h);
cyclotron_status cyclotron_integrate(cyclotron_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on cyclotron_BAD_ARGUMENT.
   Either may leave the leaf. */
cyclotron_status cyclotron_set_state(cyclotron_solver *s, const double x[cyclotron_DIM]);
cyclotron_status cyclotron_kick(cyclotron_solver *s, const double change[cyclotron_DIM]);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
cyclotron_status cyclotron_ensemble(const cyclotron_params *params, double *x, size_t members, double h,
    size_t steps, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* CYCLOTRON_H */
