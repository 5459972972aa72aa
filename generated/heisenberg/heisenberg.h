/*
 * The declarations of heisenberg.c. DO NOT EDIT: phigen detects changes by the checksum below.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 2d439cd0b192f120e14d82b936473eca04328a5e18972ce822b3b38b44921f1c
 */
#ifndef HEISENBERG_H
#define HEISENBERG_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define heisenberg_AXES 3 /* axes, the one with the largest stride first: i, j, k */
#define heisenberg_DIM 3  /* fields of a site: x, y, z */
#define heisenberg_ORDER 2
#define heisenberg_CASIMIRS 1 /* C */
#define heisenberg_PHIGEN_VERSION "0.1.0"
#define heisenberg_SPEC_SHA256 "7921ad0b2dfe94f16a5ca9b3ad035efb07fc8c8b5906b0ced5d71cbbdbeb56d4"

typedef struct {
    double J;        /* default 1.0 */
    const double *B; /* at sites: field along z; NULL for the default everywhere */
} heisenberg_params;

extern const heisenberg_params heisenberg_default_params;

enum { heisenberg_ARRAYS = 4 };        /* number of arrays over sites: fields, parameters */
enum { heisenberg_COEFFICIENTS = 18 }; /* number of coefficients: functions of params and h */

typedef enum { heisenberg_OK = 0, heisenberg_NO_CONVERGENCE, heisenberg_SINGULAR, heisenberg_NOT_FINITE,
    heisenberg_BAD_ARGUMENT } heisenberg_status;

/* A solver, initialised by heisenberg_init. Its arrays lie in memory of the caller, so a copy is no
   independent solver. Fields are stored in rows along the last axis. If steps read neighbours, a row has a
   halo: beside each end, copies of the sites at the opposite end. Callers may only read the struct. */
typedef struct {
    size_t sizes[heisenberg_AXES]; /* number of sites along each axis */
    size_t sites, rows; /* number of sites, and of rows */
    ptrdiff_t length, width; /* number of sites of a row; number of doubles from a row to the next */
    double *x[heisenberg_ARRAYS]; /* the values of fields, then of parameters at sites */
    double *before[heisenberg_DIM]; /* copies of the fields, to restore them if a step fails */
    ptrdiff_t *lines; /* for each row: its offset, and the offsets of the rows beside it */
    int open; /* 1 if x includes the last flow of the last step, but the state in `before` does not */
    size_t full_range; /* the next `full_range` steps use slower functions, for arguments of any size */
    size_t steps; /* number of successful steps since heisenberg_init */
    double t; /* time since heisenberg_init */
    double h; /* size of the last step */
    heisenberg_params params; /* the parameters, set by heisenberg_init */
    double coef[heisenberg_COEFFICIENTS]; /* functions of params and h */
    int prepared; /* 1 if coef has been computed */
    size_t steps_before_h; /* steps and t at the last change of h: t = t_before_h + (steps since then) h */
    double t_before_h;
} heisenberg_solver;

/* Number of bytes that heisenberg_init needs for these sizes; 0 if they are not admissible. */
size_t heisenberg_work_size(const size_t sizes[heisenberg_AXES]);

/* Initialise *s with the state x0[field][site], the last axis fastest. `work` has heisenberg_work_size(sizes)
   bytes, aligned as by malloc, and must outlive *s. params may be NULL for the defaults; its arrays are
   copied. Returns heisenberg_BAD_ARGUMENT if sizes are not admissible, a value is not finite, or a parameter
   that must be positive is not. */
heisenberg_status heisenberg_init(heisenberg_solver *s, const heisenberg_params *params,
    const size_t sizes[heisenberg_AXES], const double *x0, void *work);

/* Make one step, or many, of size h, which may be negative. If a step fails, the state before it is kept, and
   s->steps counts the successful steps. The last flow of a step is merged with the first of the next step or
   call. With OpenMP, threads share the sites; the number of threads does not change results. */
heisenberg_status heisenberg_step(heisenberg_solver *s, double h);
heisenberg_status heisenberg_integrate(heisenberg_solver *s, double h, size_t steps);

/* Copy the state to x[field][site]. */
void heisenberg_state(const heisenberg_solver *s, double *x);

/* Between steps: replace the state by x[field][site], or add change[field][site] to it. Returns
   heisenberg_BAD_ARGUMENT and leaves the state unchanged if the new state is not finite. */
heisenberg_status heisenberg_set_state(heisenberg_solver *s, const double *x);
heisenberg_status heisenberg_kick(heisenberg_solver *s, const double *change);

/* Between steps: replace the parameters; the state and the time remain. params must not be NULL; NULL for one
   of its arrays means the default values. Returns heisenberg_BAD_ARGUMENT for parameters that heisenberg_init
   refuses, and then changes nothing. */
heisenberg_status heisenberg_set_parameters(heisenberg_solver *s, const heisenberg_params *params);

/* Save a run, and restore it so that it continues with the same bits. heisenberg_saved writes *full_range and
   x[array][site], and returns the number of arrays: at most heisenberg_DIM, or 3 heisenberg_DIM with
   compensated steps. heisenberg_resume takes these values, after heisenberg_init. */
size_t heisenberg_saved(const heisenberg_solver *s, double *x, size_t *full_range);
heisenberg_status heisenberg_resume(heisenberg_solver *s, double h, const double *x, size_t fields,
    size_t full_range);

/* Functions of the present state: the Hamiltonian; its density out[site]; the densities out[k][site] of the
   Casimirs; the right-hand side out[field][site] of the equations of motion. */
double heisenberg_hamiltonian(const heisenberg_solver *s);
void heisenberg_density(const heisenberg_solver *s, double *out);
void heisenberg_casimirs(const heisenberg_solver *s, double *out);
void heisenberg_vector_field(const heisenberg_solver *s, double *out);

/* Caller-driven stepping, for lattices distributed over several memories. A plane is all sites with the same
   index of the first axis. A step consists of the stages 0 ... heisenberg_stages() - 1; each is a sweep over
   all planes. Without noise, there is one more stage, number heisenberg_stages(): the last stage of a step
   merged with the first of the next step. heisenberg_integrate merges them too. A stage may be computed in
   parts, in any order; the result has the same bits as heisenberg_step. Before a part is computed, all planes
   that it reads must have completed the earlier stages. */
typedef struct {
    /* number of planes that are read before the first updated one, and after the last */
    size_t behind, ahead;
    /* bit k of `read`: field k is read beyond the updated planes; bit k of `changed`: field k is updated */
    unsigned long read, changed;
} heisenberg_stage;

size_t heisenberg_stages(void);
/* writes to *about what stage `number` reads and updates */
heisenberg_status heisenberg_describe(size_t number, heisenberg_stage *about);

/* heisenberg_begin computes the coefficients for a step size; call it before the first stage.
   heisenberg_sweep makes a stage for the planes `from` ... `to` - 1. With full_range = 1, it uses functions
   for arguments of any size; with full_range = 0, it uses faster functions, which give NaN if an argument is
   too large. */
heisenberg_status heisenberg_begin(heisenberg_solver *s, double h);
heisenberg_status heisenberg_sweep(heisenberg_solver *s, size_t number, int full_range, size_t from,
    size_t to);

/* Read or write the values x[plane][site] of field number `field` on the planes `from` ... `to` - 1. Fields
   and planes are counted from 0. heisenberg_holds returns 1 if all fields are finite on these planes. */
heisenberg_status heisenberg_planes(const heisenberg_solver *s, size_t field, size_t from, size_t to,
    double *x);
heisenberg_status heisenberg_put_planes(heisenberg_solver *s, size_t field, size_t from, size_t to,
    const double *x);
int heisenberg_holds(const heisenberg_solver *s, size_t from, size_t to);

const char *heisenberg_status_string(heisenberg_status status);

/* For other languages: the size of the struct in bytes, and its number of successful steps. */
size_t heisenberg_solver_size(void);
size_t heisenberg_solver_steps_done(const heisenberg_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* HEISENBERG_H */
