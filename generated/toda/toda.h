/*
 * The declarations of toda.c. DO NOT EDIT: phigen detects changes by the checksum below.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: d97e83df26bb7aa4f4a0ecd65c5783cf0ca9ebe7fab1db2e388dcfe956b34f7f
 */
#ifndef TODA_H
#define TODA_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define toda_AXES 1 /* axes: i */
#define toda_DIM 2  /* fields of a site: a, b */
#define toda_ORDER 4
#define toda_CASIMIRS 2 /* momentum, length */
#define toda_PHIGEN_VERSION "0.1.0"
#define toda_SPEC_SHA256 "fdb12f10a633d60a892c40686358bece67d0d7d2e0a768bf8ec3914cdf17aeac"

typedef struct {
    char unused; /* this system has no parameters */
} toda_params;

extern const toda_params toda_default_params;

enum { toda_ARRAYS = 2 };        /* number of arrays over sites: fields, parameters */
enum { toda_COEFFICIENTS = 28 }; /* number of coefficients: functions of params and h */

typedef enum { toda_OK = 0, toda_NO_CONVERGENCE, toda_SINGULAR, toda_NOT_FINITE,
    toda_BAD_ARGUMENT } toda_status;

/* A solver, initialised by toda_init. Its arrays lie in memory of the caller, so a copy is no independent
   solver. Fields are stored in rows along the last axis. If steps read neighbours, a row has a halo: beside
   each end, copies of the sites at the opposite end. Callers may only read the struct. */
typedef struct {
    size_t sizes[toda_AXES]; /* number of sites along each axis */
    size_t sites, rows; /* number of sites, and of rows */
    ptrdiff_t length, width; /* number of sites of a row; number of doubles from a row to the next */
    double *x[toda_ARRAYS]; /* the values of fields, then of parameters at sites */
    double *before[toda_DIM]; /* copies of the fields, to restore them if a step fails */
    int open; /* 1 if x includes the last flow of the last step, but the state in `before` does not */
    size_t full_range; /* the next `full_range` steps use slower functions, for arguments of any size */
    size_t steps; /* number of successful steps since toda_init */
    double t; /* time since toda_init */
    double h; /* size of the last step */
    toda_params params; /* the parameters, set by toda_init */
    double coef[toda_COEFFICIENTS]; /* functions of params and h */
    int prepared; /* 1 if coef has been computed */
    size_t steps_before_h; /* steps and t at the last change of h: t = t_before_h + (steps since then) h */
    double t_before_h;
} toda_solver;

/* Number of bytes that toda_init needs for these sizes; 0 if they are not admissible. */
size_t toda_work_size(const size_t sizes[toda_AXES]);

/* Initialise *s with the state x0[field][site], the last axis fastest. `work` has toda_work_size(sizes)
   bytes, aligned as by malloc, and must outlive *s. params may be NULL for the defaults; its arrays are
   copied. Returns toda_BAD_ARGUMENT if sizes are not admissible, a value is not finite, or a parameter that
   must be positive is not. */
toda_status toda_init(toda_solver *s, const toda_params *params, const size_t sizes[toda_AXES],
    const double *x0, void *work);

/* Make one step, or many, of size h, which may be negative. If a step fails, the state before it is kept, and
   s->steps counts the successful steps. The last flow of a step is merged with the first of the next step or
   call. With OpenMP, threads share the sites; the number of threads does not change results. */
toda_status toda_step(toda_solver *s, double h);
toda_status toda_integrate(toda_solver *s, double h, size_t steps);

/* Copy the state to x[field][site]. */
void toda_state(const toda_solver *s, double *x);

/* Save a run, and restore it so that it continues with the same bits. toda_saved writes *full_range and
   x[array][site], and returns the number of arrays: at most toda_DIM, or 3 toda_DIM with compensated steps.
   toda_resume takes these values, after toda_init. */
size_t toda_saved(const toda_solver *s, double *x, size_t *full_range);
toda_status toda_resume(toda_solver *s, double h, const double *x, size_t fields, size_t full_range);

/* Functions of the present state: the Hamiltonian; its density out[site]; the densities out[k][site] of the
   Casimirs; the right-hand side out[field][site] of the equations of motion. */
double toda_hamiltonian(const toda_solver *s);
void toda_density(const toda_solver *s, double *out);
void toda_casimirs(const toda_solver *s, double *out);
void toda_vector_field(const toda_solver *s, double *out);

const char *toda_status_string(toda_status status);

/* For other languages: the size of the struct in bytes, and its number of successful steps. */
size_t toda_solver_size(void);
size_t toda_solver_steps_done(const toda_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* TODA_H */
