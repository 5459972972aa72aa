/*
 * The declarations of point_vortices.c. DO NOT EDIT: phigen detects changes by the checksum below.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: c47560ada8f6ad289d22bb3474dbd27a37134a00d63e339a8e9990805e4361e9
 */
#ifndef POINT_VORTICES_H
#define POINT_VORTICES_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define point_vortices_AXES 1 /* axes: i */
#define point_vortices_DIM 2  /* fields of a site: x, y */
#define point_vortices_ORDER 4
#define point_vortices_CASIMIRS 0
#define point_vortices_PHIGEN_VERSION "0.1.0"
#define point_vortices_SPEC_SHA256 "d965bd92c708d41161c8d57d8630c9397f72d5c2059658e2d8ea3f1387ba2750"

typedef struct {
    const double *G; /* at sites: circulation; required (no default) */
} point_vortices_params;

extern const point_vortices_params point_vortices_default_params;

enum { point_vortices_ARRAYS = 3 };       /* number of arrays over sites: fields, parameters */
enum { point_vortices_COEFFICIENTS = 5 }; /* number of coefficients: functions of params and h */
enum { point_vortices_STAGES = 5 };       /* number of stages of a step */
enum { point_vortices_DIRECTIONS = 24 };  /* largest dimension of a Krylov space of Newton's method */
enum { point_vortices_DIFFERENCES = 2 };  /* number of differences in the predictor of a stage */
enum { point_vortices_GATHERED = 4 };     /* for each site, number of stored sums over its bonds or pairs */

typedef enum { point_vortices_OK = 0, point_vortices_NO_CONVERGENCE, point_vortices_SINGULAR,
    point_vortices_NOT_FINITE, point_vortices_BAD_ARGUMENT } point_vortices_status;

/* Predictor of the solution y of an implicit stage: backward differences of the last values of y - x, from
   which the starting value of the iteration is extrapolated. */
typedef struct {
    /* number of stored differences, and number of differences whose sum is the prediction */
    int count, order;
    double *difference[point_vortices_DIFFERENCES][point_vortices_DIM];
} point_vortices_predictor;

/* A solver, initialised by point_vortices_init. Its arrays lie in memory of the caller, so a copy is no
   independent solver. Fields are stored in rows along the last axis. If steps read neighbours, a row has a
   halo: beside each end, copies of the sites at the opposite end. Callers may only read the struct. */
typedef struct {
    size_t sizes[point_vortices_AXES]; /* number of sites along each axis */
    size_t sites, rows; /* number of sites, and of rows */
    ptrdiff_t length, width; /* number of sites of a row; number of doubles from a row to the next */
    double *x[point_vortices_ARRAYS]; /* the values of fields, then of parameters at sites */
    double *before[point_vortices_DIM]; /* copies of the fields, to restore them if a step fails */
    double *gathered[point_vortices_GATHERED]; /* for each site, sums over its bonds or over all pairs */
    /* two solutions of a stage, each with parameters at sites: before and after a sweep of all sites */
    double *y[2][point_vortices_ARRAYS];
    point_vortices_predictor predictor[point_vortices_STAGES]; /* predictor of each stage */
    size_t sweeps; /* number of sweeps of all stages since point_vortices_init */
    int stiff; /* 1 if fixed-point sweeps have failed, so that Newton's method is used */
    double usual[point_vortices_DIM]; /* magnitudes of the fields of y */
    /* basis of the Krylov space, sums over row segments: see point_vortices_krylov */
    double *space[point_vortices_DIRECTIONS + 1][point_vortices_DIM], *sums;
    size_t steps; /* number of successful steps since point_vortices_init */
    double t; /* time since point_vortices_init */
    double h; /* size of the last step */
    point_vortices_params params; /* the parameters, set by point_vortices_init */
    double coef[point_vortices_COEFFICIENTS]; /* functions of params and h */
    int prepared; /* 1 if coef has been computed */
    size_t steps_before_h; /* steps and t at the last change of h: t = t_before_h + (steps since then) h */
    double t_before_h;
} point_vortices_solver;

/* Number of bytes that point_vortices_init needs for these sizes; 0 if they are not admissible. */
size_t point_vortices_work_size(const size_t sizes[point_vortices_AXES]);

/* Initialise *s with the state x0[field][site], the last axis fastest. `work` has
   point_vortices_work_size(sizes) bytes, aligned as by malloc, and must outlive *s. params must not be NULL,
   nor those of its arrays that have no default; all arrays are copied. Returns point_vortices_BAD_ARGUMENT if
   sizes are not admissible, params or a required array is NULL, a value is not finite, or a parameter that
   must be positive is not. */
point_vortices_status point_vortices_init(point_vortices_solver *s, const point_vortices_params *params,
    const size_t sizes[point_vortices_AXES], const double *x0, void *work);

/* Make one step, or many, of size h, which may be negative. If a step fails, the state before it is kept, and
   s->steps counts the successful steps. With OpenMP, threads share the sites; the number of threads does not
   change results. */
point_vortices_status point_vortices_step(point_vortices_solver *s, double h);
point_vortices_status point_vortices_integrate(point_vortices_solver *s, double h, size_t steps);

/* Copy the state to x[field][site]. */
void point_vortices_state(const point_vortices_solver *s, double *x);

/* Between steps: replace the state by x[field][site], or add change[field][site] to it. Returns
   point_vortices_BAD_ARGUMENT and leaves the state unchanged if the new state is not finite. */
point_vortices_status point_vortices_set_state(point_vortices_solver *s, const double *x);
point_vortices_status point_vortices_kick(point_vortices_solver *s, const double *change);

/* Between steps: replace the parameters; the state and the time remain. params must not be NULL; NULL for one
   of its arrays means the default values. Returns point_vortices_BAD_ARGUMENT for parameters that
   point_vortices_init refuses, and then changes nothing. */
point_vortices_status point_vortices_set_parameters(point_vortices_solver *s,
    const point_vortices_params *params);

/* Functions of the present state: the Hamiltonian; its density out[site]; the densities out[k][site] of the
   Casimirs; the right-hand side out[field][site] of the equations of motion. */
double point_vortices_hamiltonian(const point_vortices_solver *s);
void point_vortices_density(const point_vortices_solver *s, double *out);
void point_vortices_casimirs(const point_vortices_solver *s, double *out);
void point_vortices_vector_field(const point_vortices_solver *s, double *out);

const char *point_vortices_status_string(point_vortices_status status);

/* For other languages: the size of the struct in bytes, and its number of successful steps. */
size_t point_vortices_solver_size(void);
size_t point_vortices_solver_steps_done(const point_vortices_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* POINT_VORTICES_H */
