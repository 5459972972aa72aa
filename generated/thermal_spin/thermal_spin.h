/*
 * The declarations of thermal_spin.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 9b84463475840935a15c105dc6ff8c2854567db034d9836f6d34644cf7b8ab15
 */
#ifndef THERMAL_SPIN_H
#define THERMAL_SPIN_H
#include <stddef.h>
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif
#define thermal_spin_DIM 3 /* coordinates: x, y, z */
#define thermal_spin_ORDER 2
#define thermal_spin_CASIMIRS 1 /* length */
#define thermal_spin_PHIGEN_VERSION "0.1.0"
#define thermal_spin_SPEC_SHA256 "94027d99f63156278559cc210d53326037ddbd17e39528977f9fdc3b323e1de6"
enum { thermal_spin_COEFFICIENTS = 13 }; /* numbers that depend on params and h, and on the noise */
enum { thermal_spin_SOURCES = 3 };       /* of noise: bath_x, bath_y, bath_z */
enum { thermal_spin_DRAWS = 3 };         /* increments of the noise in a step */
enum { thermal_spin_PARTS = 1 };         /* increments of one source in a step, each of a part of it */

typedef struct {
    double B;            /* field along z */
    double T;            /* temperature */
    double damping_rate; /* of Landau and Lifshitz */
} thermal_spin_params;
extern const thermal_spin_params thermal_spin_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) (grad H(x) + zeta(x)) + f(x). params may be
   NULL. */
double thermal_spin_hamiltonian(const thermal_spin_params *params, const double x[3]);
void thermal_spin_casimirs(const thermal_spin_params *params, const double x[3], double out[]);
void thermal_spin_vector_field(const thermal_spin_params *params, const double x[3], double out[3]);

/* sigma pi(x) grad g(x) of each source of noise, one after the other; params may be NULL. */
void thermal_spin_noise_fields(const thermal_spin_params *params, const double x[3], double out[9]);

typedef enum { thermal_spin_OK = 0, thermal_spin_NO_CONVERGENCE, thermal_spin_SINGULAR,
    thermal_spin_NOT_FINITE, thermal_spin_BAD_ARGUMENT } thermal_spin_status;
const char *thermal_spin_status_string(thermal_spin_status status);

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[thermal_spin_DIM];     /* the state; read it freely, change it only through functions */
    double carry[thermal_spin_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                   /* good steps since thermal_spin_init */
    size_t evaluations;             /* of the generating function, for statistics */
    double t;                       /* time since thermal_spin_init */
    uint64_t seed, first_step;      /* which random numbers are taken, see thermal_spin_set_noise */
    uint32_t member;
    double dw[thermal_spin_DRAWS]; /* the increments of the noise in the last step */
    double h;                      /* the last step size; NaN before the first step */
    thermal_spin_params params;
    /* what depends on params and h only, then on dw and the time as well */
    double coef[thermal_spin_COEFFICIENTS];
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} thermal_spin_solver;
size_t thermal_spin_solver_size(void); /* for bindings to other languages, as what follows */
size_t thermal_spin_solver_steps_done(const thermal_spin_solver *s);

/* Start at x0. params may be NULL for the defaults. thermal_spin_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
thermal_spin_status thermal_spin_init(thermal_spin_solver *s, const thermal_spin_params *params,
    const double x0[thermal_spin_DIM]);

/* Which random numbers the next steps take: they are a function of the seed, the member and the number of the
   step, and of nothing else. thermal_spin_init begins with 0, 0, 0. Each increment of the noise is normal
   with variance |h|, cut off at thermal_spin_BOUND sqrt(|h|). */
thermal_spin_status thermal_spin_set_noise(thermal_spin_solver *s, uint64_t seed, uint32_t member,
    uint64_t step);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
thermal_spin_status thermal_spin_step(thermal_spin_solver *s, double h);
thermal_spin_status thermal_spin_integrate(thermal_spin_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on thermal_spin_BAD_ARGUMENT.
   Either may leave the leaf. */
thermal_spin_status thermal_spin_set_state(thermal_spin_solver *s, const double x[thermal_spin_DIM]);
thermal_spin_status thermal_spin_kick(thermal_spin_solver *s, const double change[thermal_spin_DIM]);

/* The same with increments of one's own, dw[k * thermal_spin_DRAWS + i] that of source i in step k; NULL for
   random ones. */
thermal_spin_status thermal_spin_integrate_along(thermal_spin_solver *s, double h, size_t steps,
    const double *dw);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
thermal_spin_status thermal_spin_ensemble(const thermal_spin_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

/* The same where member m takes the random numbers of first_member + m, from those of first_step on; these
   and the seed are 0 for thermal_spin_ensemble. With OpenMP, members in parallel: the results do not depend
   on threads. */
thermal_spin_status thermal_spin_ensemble_of(const thermal_spin_params *params, double *x, size_t members,
    double h, size_t steps, uint64_t seed, uint32_t first_member, uint64_t first_step, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* THERMAL_SPIN_H */
