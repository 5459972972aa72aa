/*
 * The declarations of food_web.c. DO NOT EDIT: phigen detects changes by the checksum below.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: b161a98329a1c1f751007e2d940cbe282f263020b9ccfa31ef25c519f294d8e6
 */
#ifndef FOOD_WEB_H
#define FOOD_WEB_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define food_web_AXES 1 /* axes: i */
#define food_web_DIM 1  /* fields of a site: x */
#define food_web_ORDER 4
#define food_web_CASIMIRS 0
#define food_web_PHIGEN_VERSION "0.1.0"
#define food_web_SPEC_SHA256 "5659ee78a2bc4bebf3fe67f5487d8c66f8f2a25268cffd5580783f1fe03a2f6f"

typedef struct {
    const double *A; /* at bonds: strength of the interaction; NULL for the default everywhere */
    const double *k; /* at sites: equilibrium; NULL for the default everywhere */
} food_web_params;

extern const food_web_params food_web_default_params;

enum { food_web_ARRAYS = 2 };        /* number of arrays over sites: fields, parameters */
enum { food_web_COEFFICIENTS = 26 }; /* number of coefficients: functions of params and h */
enum { food_web_GATHERED = 1 };      /* for each site, number of stored sums over its bonds or pairs */
enum { food_web_BOND_ARRAYS = 1 };   /* number of parameters at bonds */

typedef enum { food_web_OK = 0, food_web_NO_CONVERGENCE, food_web_SINGULAR, food_web_NOT_FINITE,
    food_web_BAD_ARGUMENT } food_web_status;

/* A solver, initialised by food_web_init. Its arrays lie in memory of the caller, so a copy is no independent
   solver. Fields are stored in rows along the last axis. If steps read neighbours, a row has a halo: beside
   each end, copies of the sites at the opposite end. Callers may only read the struct. */
typedef struct {
    size_t sizes[food_web_AXES]; /* number of sites along each axis */
    size_t sites, rows; /* number of sites, and of rows */
    ptrdiff_t length, width; /* number of sites of a row; number of doubles from a row to the next */
    double *x[food_web_ARRAYS]; /* the values of fields, then of parameters at sites */
    double *before[food_web_DIM]; /* copies of the fields, to restore them if a step fails */
    double *gathered[food_web_GATHERED]; /* for each site, sums over its bonds or over all pairs */
    int *bonds; /* for each site, the index in `other` of the first bond that starts there */
    int *middle; /* for each site, the index in `other` of the first bond that ends there */
    int *other, *number; /* for each bond of a site: the site at the opposite end, the number of the bond */
    double *at_bonds[food_web_BOND_ARRAYS]; /* for each entry of `other`, the parameters at the bond */
    int *colours; /* colour of each site; no bond connects two sites of the same colour */
    int colour_count, flows; /* number of colours, and of flows in a stage */
    int open; /* 1 if x includes the last flow of the last step, but the state in `before` does not */
    size_t full_range; /* the next `full_range` steps use slower functions, for arguments of any size */
    size_t steps; /* number of successful steps since food_web_init */
    double t; /* time since food_web_init */
    double h; /* size of the last step */
    food_web_params params; /* the parameters, set by food_web_init */
    double coef[food_web_COEFFICIENTS]; /* functions of params and h */
    int prepared; /* 1 if coef has been computed */
    size_t steps_before_h; /* steps and t at the last change of h: t = t_before_h + (steps since then) h */
    double t_before_h;
} food_web_solver;

/* The bonds of a graph. Bond k connects the sites ends[2 * k] and ends[2 * k + 1], counted from 0. */
typedef struct {
    size_t count;
    const size_t *ends;
} food_web_bonds;

/* Bytes that food_web_init needs for these sizes and this number of bonds; 0 if they are refused. */
size_t food_web_work_size(const size_t sizes[food_web_AXES], size_t bonds);

/* Initialise *s with the state x0[field][site]. `work` has food_web_work_size(sizes, bonds->count) bytes,
   aligned as by malloc, and must outlive *s. `bonds` may be NULL if there are none, and `params` for the
   defaults. All arrays are copied. Returns food_web_BAD_ARGUMENT if sizes are refused, a bond does not
   connect two different sites, a value is not finite, or a parameter that must be positive is not. */
food_web_status food_web_init(food_web_solver *s, const food_web_params *params,
    const size_t sizes[food_web_AXES], const food_web_bonds *bonds, const double *x0, void *work);

/* Make one step, or many, of size h, which may be negative. If a step fails, the state before it is kept, and
   s->steps counts the successful steps. The last flow of a step is merged with the first of the next step or
   call. With OpenMP, threads share the sites; the number of threads does not change results. */
food_web_status food_web_step(food_web_solver *s, double h);
food_web_status food_web_integrate(food_web_solver *s, double h, size_t steps);

/* Copy the state to x[field][site]. */
void food_web_state(const food_web_solver *s, double *x);

/* Save a run, and restore it so that it continues with the same bits. food_web_saved writes *full_range and
   x[array][site], and returns the number of arrays: at most food_web_DIM, or 3 food_web_DIM with compensated
   steps. food_web_resume takes these values, after food_web_init. */
size_t food_web_saved(const food_web_solver *s, double *x, size_t *full_range);
food_web_status food_web_resume(food_web_solver *s, double h, const double *x, size_t fields,
    size_t full_range);

/* Functions of the present state: the Hamiltonian; its density out[site]; the densities out[k][site] of the
   Casimirs; the right-hand side out[field][site] of the equations of motion. */
double food_web_hamiltonian(const food_web_solver *s);
void food_web_density(const food_web_solver *s, double *out);
void food_web_casimirs(const food_web_solver *s, double *out);
void food_web_vector_field(const food_web_solver *s, double *out);

const char *food_web_status_string(food_web_status status);

/* For other languages: the size of the struct in bytes, and its number of successful steps. */
size_t food_web_solver_size(void);
size_t food_web_solver_steps_done(const food_web_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* FOOD_WEB_H */
