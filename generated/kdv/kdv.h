/*
 * The declarations of kdv.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 069e26bd85a1c23bce7bf363d9c17488f56a3534510e1685ac82570a1399bc1f
 */
#ifndef KDV_H
#define KDV_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define kdv_AXES 1 /* i */
#define kdv_DIM 1  /* fields of a site: u */
#define kdv_ORDER 2
#define kdv_CASIMIRS 1 /* mass */
#define kdv_PHIGEN_VERSION "0.1.0"
#define kdv_SPEC_SHA256 "32cf81a7dcc830b212362da02129fd35222f755f500facee761ebba58d437add"

typedef struct {
    double delta; /* default 0.022 */
    double d;     /* spacing */
} kdv_params;

extern const kdv_params kdv_default_params;

enum { kdv_ARRAYS = 1 };       /* arrays over the sites: fields, then parameters */
enum { kdv_COEFFICIENTS = 7 }; /* numbers that depend on params and h only */
enum { kdv_DIFFERENCES = 4 };  /* that a guess is extrapolated from */

typedef enum { kdv_OK = 0, kdv_NO_CONVERGENCE, kdv_SINGULAR, kdv_NOT_FINITE, kdv_BAD_ARGUMENT } kdv_status;

/* What guesses for the y of a stage are extrapolated from: differences of the last values of y - x. */
typedef struct {
    int count, order; /* differences that there are, and that the next guess takes */
    double *difference[kdv_DIFFERENCES][kdv_DIM];
} kdv_guess;

/* The state is kept in memory of the caller.
   A field is a row: all its sites, with copies of the other end beside them.
   Set it up with kdv_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[kdv_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[kdv_ARRAYS];
    double *before[kdv_DIM]; /* the fields before the steps that are being made */
    /* the middle of a stage, before and after a sweep, with the parameters at sites */
    double *y[2][kdv_ARRAYS];
    kdv_guess guess;
    size_t sweeps;          /* that stages took since kdv_init */
    int stiff;              /* whether sweeps have failed */
    double usual[kdv_DIM];  /* the sizes of the fields of y */
    const double *factored; /* the coefficients that the matrix is of, or NULL */
    double *v[kdv_DIM];     /* a variation of y */
    double *matrix;         /* see kdv_factorise */
    size_t steps;           /* good steps since kdv_init */
    double t;               /* time since kdv_init */
    double h;               /* the last step size */
    kdv_params params;
    double coef[kdv_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared; /* whether coef has been computed */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} kdv_solver;

/* The bytes that the solver of a lattice needs as its memory; 0 for sizes that are not allowed. */
size_t kdv_work_size(const size_t sizes[kdv_AXES]);

/* Start at x0[field][site], the last axis fastest, with kdv_work_size(sizes) bytes of memory, as from malloc,
   which must stay. params may be NULL for the defaults; its arrays are copied. kdv_BAD_ARGUMENT if sizes are
   not allowed, x0 or a parameter is not finite, or one that has to be positive is not. */
kdv_status kdv_init(kdv_solver *s, const kdv_params *params, const size_t sizes[kdv_AXES], const double *x0,
    void *work);

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good
   ones. Guesses are extrapolated from the former steps of one call. With OpenMP rows are worked at in
   parallel, with the same bits for any number of threads. */
kdv_status kdv_step(kdv_solver *s, double h);
kdv_status kdv_integrate(kdv_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void kdv_state(const kdv_solver *s, double *x);

/* Between steps: stand at x, or move by change, both [field][site], all else being as it was, also on
   kdv_BAD_ARGUMENT. */
kdv_status kdv_set_state(kdv_solver *s, const double *x);
kdv_status kdv_kick(kdv_solver *s, const double *change);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double kdv_hamiltonian(const kdv_solver *s);
void kdv_density(const kdv_solver *s, double *out);
void kdv_casimirs(const kdv_solver *s, double *out);
void kdv_vector_field(const kdv_solver *s, double *out);

const char *kdv_status_string(kdv_status status);

/* For bindings: the size of kdv_solver, and its count of good steps. */
size_t kdv_solver_size(void);
size_t kdv_solver_steps_done(const kdv_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* KDV_H */
