/*
 * The declarations of double_well.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: fda1fdec722d1c58e51b1dcac211c25c844efe6d15415bb5d0a1a4dc67a32cb9
 */
#ifndef DOUBLE_WELL_H
#define DOUBLE_WELL_H
#include <stddef.h>
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif
#define double_well_DIM 2 /* coordinates: q, p */
#define double_well_ORDER 2
#define double_well_CASIMIRS 0
#define double_well_PHIGEN_VERSION "0.1.0"
#define double_well_SPEC_SHA256 "0601523ef6377cf687c3f6e7ce01a7ca92d1fa3aab823b00499b6553011ac36c"
enum { double_well_COEFFICIENTS = 10 }; /* numbers that depend on params and h, and on the noise */
enum { double_well_SOURCES = 1 };       /* of noise: bath */
enum { double_well_DRAWS = 1 };         /* increments of the noise in a step */
enum { double_well_PARTS = 1 };         /* increments of one source in a step, each of a part of it */

typedef struct {
    double barrier; /* default 1.0 */
    double gamma;   /* friction */
    double T;       /* temperature */
} double_well_params;
extern const double_well_params double_well_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) (grad H(x) + zeta(x)) + f(x). params may be
   NULL. */
double double_well_hamiltonian(const double_well_params *params, const double x[2]);
void double_well_casimirs(const double_well_params *params, const double x[2], double out[]);
void double_well_vector_field(const double_well_params *params, const double x[2], double out[2]);

/* sigma pi(x) grad g(x) of each source of noise, one after the other; params may be NULL. */
void double_well_noise_fields(const double_well_params *params, const double x[2], double out[2]);

typedef enum { double_well_OK = 0, double_well_NO_CONVERGENCE, double_well_SINGULAR, double_well_NOT_FINITE,
    double_well_BAD_ARGUMENT } double_well_status;
const char *double_well_status_string(double_well_status status);

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[double_well_DIM];     /* the state; read it freely, change it only through functions */
    double carry[double_well_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                  /* good steps since double_well_init */
    size_t evaluations;            /* of the generating function, for statistics */
    double t;                      /* time since double_well_init */
    uint64_t seed, first_step;     /* which random numbers are taken, see double_well_set_noise */
    uint32_t member;
    double dw[double_well_DRAWS]; /* the increments of the noise in the last step */
    double h;                     /* the last step size; NaN before the first step */
    double_well_params params;
    /* what depends on params and h only, then on dw and the time as well */
    double coef[double_well_COEFFICIENTS];
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} double_well_solver;
size_t double_well_solver_size(void); /* for bindings to other languages, as what follows */
size_t double_well_solver_steps_done(const double_well_solver *s);

/* Start at x0. params may be NULL for the defaults. double_well_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
double_well_status double_well_init(double_well_solver *s, const double_well_params *params,
    const double x0[double_well_DIM]);

/* Which random numbers the next steps take: they are a function of the seed, the member and the number of the
   step, and of nothing else. double_well_init begins with 0, 0, 0. Each increment of the noise is normal with
   variance |h|, cut off at double_well_BOUND sqrt(|h|). */
double_well_status double_well_set_noise(double_well_solver *s, uint64_t seed, uint32_t member,
    uint64_t step);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
double_well_status double_well_step(double_well_solver *s, double h);
double_well_status double_well_integrate(double_well_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on double_well_BAD_ARGUMENT.
   Either may leave the leaf. */
double_well_status double_well_set_state(double_well_solver *s, const double x[double_well_DIM]);
double_well_status double_well_kick(double_well_solver *s, const double change[double_well_DIM]);

/* The same with increments of one's own, dw[k * double_well_DRAWS + i] that of source i in step k; NULL for
   random ones. */
double_well_status double_well_integrate_along(double_well_solver *s, double h, size_t steps,
    const double *dw);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
double_well_status double_well_ensemble(const double_well_params *params, double *x, size_t members, double h,
    size_t steps, unsigned char *status);

/* The same where member m takes the random numbers of first_member + m, from those of first_step on; these
   and the seed are 0 for double_well_ensemble. With OpenMP, members in parallel: the results do not depend on
   threads. */
double_well_status double_well_ensemble_of(const double_well_params *params, double *x, size_t members,
    double h, size_t steps, uint64_t seed, uint32_t first_member, uint64_t first_step, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* DOUBLE_WELL_H */
