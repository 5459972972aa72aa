/*
 * The declarations of thermal_spin.c. DO NOT EDIT: phigen detects changes by the checksum below.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 46f9518e6c0b646e887d7feb620bf95f819db640d432a1284d9e5291e080aff2
 */
#ifndef THERMAL_SPIN_H
#define THERMAL_SPIN_H
#include <stddef.h>
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif
#define thermal_spin_DIM 3      /* coordinates: x, y, z */
#define thermal_spin_ORDER 2    /* order of the method */
#define thermal_spin_CASIMIRS 1 /* Casimirs: length */
#define thermal_spin_PHIGEN_VERSION "0.1.0"
#define thermal_spin_SPEC_SHA256 "c2605a05b4723f47754072482f3271466da9eaeb4a192c560cd7dc077895ddeb"
/* number of coefficients: functions of params and h, and of the noise */
enum { thermal_spin_COEFFICIENTS = 13 };
enum { thermal_spin_SOURCES = 3 }; /* sources of noise: bath_x, bath_y, bath_z */
enum { thermal_spin_DRAWS = 3 };   /* number of increments of all sources of noise in a step */
enum { thermal_spin_PARTS = 1 };   /* number of increments of one source of noise in a step */

typedef struct {
    double B;            /* field along z */
    double T;            /* temperature */
    double damping_rate; /* Landau–Lifshitz damping */
} thermal_spin_params;
extern const thermal_spin_params thermal_spin_default_params;

/* The Hamiltonian; the Casimirs; the right-hand side pi(x) (grad H(x) + zeta(x)) + f(x), with the forces zeta
   and f. params may be NULL. */
double thermal_spin_hamiltonian(const thermal_spin_params *params, const double x[3]);
void thermal_spin_casimirs(const thermal_spin_params *params, const double x[3], double out[]);
void thermal_spin_vector_field(const thermal_spin_params *params, const double x[3], double out[3]);

/* For each source of noise with the amplitude sigma and the Hamiltonian g: the vector field sigma pi(x) grad
   g(x). params may be NULL. */
void thermal_spin_noise_fields(const thermal_spin_params *params, const double x[3], double out[9]);

typedef enum { thermal_spin_OK = 0, thermal_spin_NO_CONVERGENCE, thermal_spin_SINGULAR,
    thermal_spin_NOT_FINITE, thermal_spin_BAD_ARGUMENT } thermal_spin_status;
const char *thermal_spin_status_string(thermal_spin_status status); /* the meaning of a status */

/* A copy of this struct is an independent solver. Arguments of functions may point into it, or overlap. */
typedef struct {
    double x[thermal_spin_DIM]; /* the state; change it only by the functions below */
    double carry[thermal_spin_DIM]; /* rounding error of x: x + carry is more accurate */
    size_t steps; /* number of successful steps since thermal_spin_init */
    size_t evaluations; /* number of evaluations of the generating function, for statistics */
    double t; /* time since thermal_spin_init */
    uint64_t seed, first_step; /* select, with `member`, the random numbers: see thermal_spin_set_noise */
    uint32_t member;
    double dw[thermal_spin_DRAWS]; /* increments of the noise in the last step */
    double h; /* size of the last step; NaN before the first step */
    thermal_spin_params params; /* the parameters, set by thermal_spin_init; do not change them */
    double coef[thermal_spin_COEFFICIENTS]; /* functions of params and h; then those that also depend on dw */
    size_t steps_before_h; /* steps and t at the last change of h: t = t_before_h + (steps since then) h */
    double t_before_h;
} thermal_spin_solver;
size_t thermal_spin_solver_size(void); /* in bytes, for languages that cannot read the struct */
size_t thermal_spin_solver_steps_done(const thermal_spin_solver *s);

/* Initialise *s with the state x0; params = NULL for the defaults. Returns thermal_spin_BAD_ARGUMENT, with *s
   unchanged, if a value or coefficient is not finite, or a parameter that must be positive is not. */
thermal_spin_status thermal_spin_init(thermal_spin_solver *s, const thermal_spin_params *params,
    const double x0[thermal_spin_DIM]);

/* Select the random numbers of the next steps. They are a function of seed, ensemble member and number of the
   step, which is `step` for the next step; thermal_spin_init sets seed, member and step to 0. Each increment
   of the noise is normal with variance |h|, truncated at thermal_spin_BOUND sqrt(|h|). */
thermal_spin_status thermal_spin_set_noise(thermal_spin_solver *s, uint64_t seed, uint32_t member,
    uint64_t step);

/* Make steps of size h, of either sign. If a step fails, s->x and s->steps remain those before this step. */
thermal_spin_status thermal_spin_step(thermal_spin_solver *s, double h);
thermal_spin_status thermal_spin_integrate(thermal_spin_solver *s, double h, size_t steps);

/* Between steps: replace the state by x, or add `change` to the state. The values of Casimirs may change.
   Returns thermal_spin_BAD_ARGUMENT, with *s unchanged, if the new state is not finite. */
thermal_spin_status thermal_spin_set_state(thermal_spin_solver *s, const double x[thermal_spin_DIM]);
thermal_spin_status thermal_spin_kick(thermal_spin_solver *s, const double change[thermal_spin_DIM]);

/* As thermal_spin_integrate, with increments of the noise from the caller: dw[k * thermal_spin_DRAWS + i] is
   increment i of step k. NULL for random increments. */
thermal_spin_status thermal_spin_integrate_along(thermal_spin_solver *s, double h, size_t steps,
    const double *dw);

/* Integrate members in place: x[i * members + m] is coordinate i of member m. Failed members get their last
   good state. status[m] is for member m; `status` may be NULL. Returns the first status that is not OK. */
thermal_spin_status thermal_spin_ensemble(const thermal_spin_params *params, double *x, size_t members,
    double h, size_t steps, unsigned char *status);

/* As thermal_spin_ensemble, with selected random numbers: member m has the random numbers of `seed` and
   member number first_member + m, from step number first_step on. thermal_spin_ensemble takes 0 for seed,
   first_member and first_step. With OpenMP, members are integrated in parallel; the results do not depend on
   the number of threads. */
thermal_spin_status thermal_spin_ensemble_of(const thermal_spin_params *params, double *x, size_t members,
    double h, size_t steps, uint64_t seed, uint32_t first_member, uint64_t first_step, unsigned char *status);

#ifdef __cplusplus
}
#endif
#endif /* THERMAL_SPIN_H */
