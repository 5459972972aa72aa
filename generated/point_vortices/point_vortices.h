/*
 * The declarations of point_vortices.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 0ca8c02c960a7431aa27780c563b631264c55327d9b970f49a91d1c6f49c3409
 */
#ifndef POINT_VORTICES_H
#define POINT_VORTICES_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define point_vortices_AXES 1 /* i */
#define point_vortices_DIM 2  /* fields of a site: x, y */
#define point_vortices_ORDER 4
#define point_vortices_CASIMIRS 0
#define point_vortices_PHIGEN_VERSION "0.1.0"
#define point_vortices_SPEC_SHA256 "804a59fbd6a75ce4716246b77b3269259aad5901c7b5e0f87e175f5913fb28ec"

typedef struct {
    const double *G; /* at sites: circulation */
} point_vortices_params;

extern const point_vortices_params point_vortices_default_params;

enum { point_vortices_ARRAYS = 3 };       /* arrays over the sites: fields, then parameters */
enum { point_vortices_COEFFICIENTS = 5 }; /* numbers that depend on params and h only */
enum { point_vortices_STAGES = 5 };       /* of a step */
enum { point_vortices_DIRECTIONS = 24 };  /* of a Krylov space */
enum { point_vortices_DIFFERENCES = 2 };  /* that a guess is extrapolated from */
enum { point_vortices_GATHERED = 4 };     /* sums over other sites that are held for each site */

typedef enum { point_vortices_OK = 0, point_vortices_NO_CONVERGENCE, point_vortices_SINGULAR,
    point_vortices_NOT_FINITE, point_vortices_BAD_ARGUMENT } point_vortices_status;

/* What guesses for the y of a stage are extrapolated from: differences of the last values of y - x. */
typedef struct {
    int count, order; /* differences that there are, and that the next guess takes */
    double *difference[point_vortices_DIFFERENCES][point_vortices_DIM];
} point_vortices_guess;

/* The state is kept in memory of the caller.
   A field is a row: all its sites.
   Set it up with point_vortices_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[point_vortices_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[point_vortices_ARRAYS];
    double *gathered[point_vortices_GATHERED]; /* sums over other sites, for each site */
    double *before[point_vortices_DIM];        /* the fields before the steps that are being made */
    /* the middle of a stage, before and after a sweep, with the parameters at sites */
    double *y[2][point_vortices_ARRAYS];
    point_vortices_guess guess[point_vortices_STAGES];
    size_t sweeps;                    /* that stages took since point_vortices_init */
    int stiff;                        /* whether sweeps have failed */
    double usual[point_vortices_DIM]; /* the sizes of the fields of y */
    /* variations of y, sums over pieces: see point_vortices_krylov */
    double *space[point_vortices_DIRECTIONS + 1][point_vortices_DIM], *sums;
    size_t steps; /* good steps since point_vortices_init */
    double t;     /* time since point_vortices_init */
    double h;     /* the last step size */
    point_vortices_params params;
    double coef[point_vortices_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared; /* whether coef has been computed */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} point_vortices_solver;

/* The bytes that the solver of a lattice needs as its memory; 0 for sizes that are not allowed. */
size_t point_vortices_work_size(const size_t sizes[point_vortices_AXES]);

/* Start at x0[field][site], the last axis fastest, with point_vortices_work_size(sizes) bytes of memory, as
   from malloc, which must stay. params may be NULL for the defaults; its arrays are copied.
   point_vortices_BAD_ARGUMENT if sizes are not allowed, x0 or a parameter is not finite, or one that has to
   be positive is not. */
point_vortices_status point_vortices_init(point_vortices_solver *s, const point_vortices_params *params,
    const size_t sizes[point_vortices_AXES], const double *x0, void *work);

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good
   ones. Guesses are extrapolated from the former steps of one call. With OpenMP rows are worked at in
   parallel, with the same bits for any number of threads. */
point_vortices_status point_vortices_step(point_vortices_solver *s, double h);
point_vortices_status point_vortices_integrate(point_vortices_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void point_vortices_state(const point_vortices_solver *s, double *x);

/* Between steps: stand at x, or move by change, both [field][site], all else being as it was, also on
   point_vortices_BAD_ARGUMENT. */
point_vortices_status point_vortices_set_state(point_vortices_solver *s, const double *x);
point_vortices_status point_vortices_kick(point_vortices_solver *s, const double *change);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double point_vortices_hamiltonian(const point_vortices_solver *s);
void point_vortices_density(const point_vortices_solver *s, double *out);
void point_vortices_casimirs(const point_vortices_solver *s, double *out);
void point_vortices_vector_field(const point_vortices_solver *s, double *out);

const char *point_vortices_status_string(point_vortices_status status);

/* For bindings: the size of point_vortices_solver, and its count of good steps. */
size_t point_vortices_solver_size(void);
size_t point_vortices_solver_steps_done(const point_vortices_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* POINT_VORTICES_H */
