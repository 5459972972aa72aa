/*
 * The declarations of thermal_heisenberg.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: ce3ac4f16f250b2911b39a45c3f341b79d8fe3f3950624da1d18d7bcf9ba9874
 */
#ifndef THERMAL_HEISENBERG_H
#define THERMAL_HEISENBERG_H
#include <stddef.h>
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif
#define thermal_heisenberg_AXES 1 /* i */
#define thermal_heisenberg_DIM 3  /* fields of a site: x, y, z */
#define thermal_heisenberg_ORDER 2
#define thermal_heisenberg_CASIMIRS 1 /* C */
#define thermal_heisenberg_PHIGEN_VERSION "0.1.0"
#define thermal_heisenberg_SPEC_SHA256 "748117241853e75caf7a5478eb51e46695d29311bb8a01069042f022c6a72ad3"

typedef struct {
    double J;        /* default 1.0 */
    double lambda;   /* damping */
    const double *T; /* at sites: temperature; NULL for the default at all of them */
} thermal_heisenberg_params;

extern const thermal_heisenberg_params thermal_heisenberg_default_params;

enum { thermal_heisenberg_ARRAYS = 7 }; /* arrays over the sites: fields, then parameters, then noise */
enum { thermal_heisenberg_COEFFICIENTS = 75 }; /* numbers that depend on params and h only */

typedef enum { thermal_heisenberg_OK = 0, thermal_heisenberg_NO_CONVERGENCE, thermal_heisenberg_SINGULAR,
    thermal_heisenberg_NOT_FINITE, thermal_heisenberg_BAD_ARGUMENT } thermal_heisenberg_status;

/* The state is kept in memory of the caller.
   A field is a row: all its sites, with copies of the other end beside them.
   Set it up with thermal_heisenberg_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[thermal_heisenberg_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[thermal_heisenberg_ARRAYS];
    double *before[thermal_heisenberg_DIM]; /* the fields before the steps that are being made */
    int open; /* whether these lack the last flow of a step, which between calls x has made */
    size_t far; /* steps to be made by functions for large arguments, where there are others */
    size_t steps; /* good steps since thermal_heisenberg_init */
    double t; /* time since thermal_heisenberg_init */
    double h; /* the last step size */
    /* of the noise: its seed, and the number of the step after thermal_heisenberg_init */
    uint64_t seed, first_step;
    uint32_t member;
    thermal_heisenberg_params params;
    double coef[thermal_heisenberg_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared; /* whether coef has been computed */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} thermal_heisenberg_solver;

/* The bytes that the solver of a lattice needs as its memory; 0 for sizes that are not allowed. */
size_t thermal_heisenberg_work_size(const size_t sizes[thermal_heisenberg_AXES]);

/* Start at x0[field][site], the last axis fastest, with thermal_heisenberg_work_size(sizes) bytes of memory,
   as from malloc, which must stay. params may be NULL for the defaults; its arrays are copied.
   thermal_heisenberg_BAD_ARGUMENT if sizes are not allowed, x0 or a parameter is not finite, or one that has
   to be positive is not. */
thermal_heisenberg_status thermal_heisenberg_init(thermal_heisenberg_solver *s,
    const thermal_heisenberg_params *params, const size_t sizes[thermal_heisenberg_AXES], const double *x0,
    void *work);

/* Which random numbers the next step takes, which all sites have of their own: those of a seed, of a member
   of an ensemble, and of the number of a step, below 2^48; all are 0 before. */
thermal_heisenberg_status thermal_heisenberg_set_noise(thermal_heisenberg_solver *s, uint64_t seed,
    uint32_t member, uint64_t step);

/* Say that so many steps of size h have led to the state since thermal_heisenberg_init: to go on elsewhere
   with the same bits, and before each step that is made by hand. */
thermal_heisenberg_status thermal_heisenberg_passed(thermal_heisenberg_solver *s, double h, size_t steps);

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good
   ones. Steps are joined, also those of several calls: where one ends as the next begins, both are one flow.
   With OpenMP rows are worked at in parallel, with the same bits for any number of threads. */
thermal_heisenberg_status thermal_heisenberg_step(thermal_heisenberg_solver *s, double h);
thermal_heisenberg_status thermal_heisenberg_integrate(thermal_heisenberg_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void thermal_heisenberg_state(const thermal_heisenberg_solver *s, double *x);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double thermal_heisenberg_hamiltonian(const thermal_heisenberg_solver *s);
void thermal_heisenberg_density(const thermal_heisenberg_solver *s, double *out);
void thermal_heisenberg_casimirs(const thermal_heisenberg_solver *s, double *out);
void thermal_heisenberg_vector_field(const thermal_heisenberg_solver *s, double *out);

const char *thermal_heisenberg_status_string(thermal_heisenberg_status status);

/* For bindings: the size of thermal_heisenberg_solver, and its count of good steps. */
size_t thermal_heisenberg_solver_size(void);
size_t thermal_heisenberg_solver_steps_done(const thermal_heisenberg_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* THERMAL_HEISENBERG_H */
