/*
 * The declarations of thermal_chain.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 1395d6aec2323248c559d8a74983463aee4be2709212d8aac35a6ac3fbee1c2e
 */
#ifndef THERMAL_CHAIN_H
#define THERMAL_CHAIN_H
#include <stddef.h>
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif
#define thermal_chain_DIM 12 /* coordinates: x1, y1, z1, x2, y2, z2, x3, y3, z3, x4, y4, z4 */
#define thermal_chain_ORDER 2
#define thermal_chain_CASIMIRS 4 /* length1, length2, length3, length4 */
#define thermal_chain_PHIGEN_VERSION "0.1.0"
#define thermal_chain_SPEC_SHA256 "5d3df38060fdd4f00d014c45e35eeeca792676acb8c0de5c5229638247bbb939"
enum { thermal_chain_COEFFICIENTS = 17 }; /* numbers that depend on params and h, and on the noise */
/* of noise: bath_x1, bath_y1, bath_z1, bath_x2, bath_y2, bath_z2, bath_x3, bath_y3, bath_z3, bath_x4,
   bath_y4, bath_z4 */
enum { thermal_chain_SOURCES = 12 };
enum { thermal_chain_DRAWS = 12 }; /* increments of the noise in a step */
enum { thermal_chain_PARTS = 1 };  /* increments of one source in a step, each of a part of it */

typedef struct {
    double J;            /* exchange */
    double T;            /* temperature */
    double damping_rate; /* of Landau and Lifshitz */
} thermal_chain_params;
extern const thermal_chain_params thermal_chain_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) (grad H(x) + zeta(x)) + f(x). params may be
   NULL. */
double thermal_chain_hamiltonian(const thermal_chain_params *params, const double x[12]);
void thermal_chain_casimirs(const thermal_chain_params *params, const double x[12], double out[]);
void thermal_chain_vector_field(const thermal_chain_params *params, const double x[12], double out[12]);

/* sigma pi(x) grad g(x) of each source of noise, one after the other; params may be NULL. */
void thermal_chain_noise_fields(const thermal_chain_params *params, const double x[12], double out[144]);

typedef enum { thermal_chain_OK = 0, thermal_chain_NO_CONVERGENCE, thermal_chain_SINGULAR,
    thermal_chain_NOT_FINITE, thermal_chain_BAD_ARGUMENT } thermal_chain_status;
const char *thermal_chain_status_string(thermal_chain_status status);

/* A plain value: copy it to branch, keep one per thread. Arguments may be parts of it, or overlap. */
typedef struct {
    double x[thermal_chain_DIM];     /* the state; read it freely, change it only through functions */
    double carry[thermal_chain_DIM]; /* what rounding took from x: the state proper is x + carry */
    size_t steps;                    /* good steps since thermal_chain_init */
    size_t evaluations;              /* of the generating function, for statistics */
    double t;                        /* time since thermal_chain_init */
    uint64_t seed, first_step;       /* which random numbers are taken, see thermal_chain_set_noise */
    uint32_t member;
    double dw[thermal_chain_DRAWS]; /* the increments of the noise in the last step */
    double h;                       /* the last step size; NaN before the first step */
    thermal_chain_params params;
    /* what depends on params and h only, then on dw and the time as well */
    double coef[thermal_chain_COEFFICIENTS];
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} thermal_chain_solver;
size_t thermal_chain_solver_size(void); /* for bindings to other languages, as what follows */
size_t thermal_chain_solver_steps_done(const thermal_chain_solver *s);

/* Start at x0. params may be NULL for the defaults. thermal_chain_BAD_ARGUMENT, and *s as before, if x0, a
   parameter or what follows from parameters alone is not finite, or one not positive that has to be. */
thermal_chain_status thermal_chain_init(thermal_chain_solver *s, const thermal_chain_params *params,
    const double x0[thermal_chain_DIM]);

/* Which random numbers the next steps take: they are a function of the seed, the member and the number of the
   step, and of nothing else. thermal_chain_init begins with 0, 0, 0. Each increment of the noise is normal
   with variance |h|, cut off at thermal_chain_BOUND sqrt(|h|). */
thermal_chain_status thermal_chain_set_noise(thermal_chain_solver *s, uint64_t seed, uint32_t member,
    uint64_t step);

/* One step of size h, of either sign, or many. On failure x is the last good state, after s->steps steps. */
thermal_chain_status thermal_chain_step(thermal_chain_solver *s, double h);
thermal_chain_status thermal_chain_integrate(thermal_chain_solver *s, double h, size_t steps);

/* Between steps: stand at x, or move by change, all else being as it was, also on thermal_chain_BAD_ARGUMENT.
   Either may leave the leaf. */
thermal_chain_status thermal_chain_set_state(thermal_chain_solver *s, const double x[thermal_chain_DIM]);
thermal_chain_status thermal_chain_kick(thermal_chain_solver *s, const double change[thermal_chain_DIM]);

/* The same with increments of one's own, dw[k * thermal_chain_DRAWS + i] that of source i in step k; NULL for
   random ones. */
thermal_chain_status thermal_chain_integrate_along(thermal_chain_solver *s, double h, size_t steps,
    const double *dw);

/* Many members, in place: x[i * members + m] is coordinate i of member m. One that fails keeps its last good
   state. status (or NULL) receives the status of each; the first that is not OK is returned. */
thermal_chain_status thermal_chain_ensemble(const thermal_chain_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

/* The same where member m takes the random numbers of first_member + m, from those of first_step on; these
   and the seed are 0 for thermal_chain_ensemble. With OpenMP, members in parallel: the results do not depend
   on threads. */
thermal_chain_status thermal_chain_ensemble_of(const thermal_chain_params *params, double *x, size_t members,
    double h, size_t steps, uint64_t seed, uint32_t first_member, uint64_t first_step, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* THERMAL_CHAIN_H */
