/*
 * The declarations of heisenberg_plane.c. DO NOT EDIT: the checksum below notices.
 * SPDX-License-Identifier: 0BSD
 * body-sha256: 019472fed12b5b7992ae3347c6e175b97d8e024fb456bed2920d5b9d10c806c6
 */
#ifndef HEISENBERG_PLANE_H
#define HEISENBERG_PLANE_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif
#define heisenberg_plane_AXES 2 /* the slowest first: i, j */
#define heisenberg_plane_DIM 3  /* fields of a site: x, y, z */
#define heisenberg_plane_ORDER 4
#define heisenberg_plane_CASIMIRS 1 /* C */
#define heisenberg_plane_PHIGEN_VERSION "0.1.0"
#define heisenberg_plane_SPEC_SHA256 "b4d9835fedde5fe8efc99c52b6d75d2aea230d5d018b706b644d6c59a4034bd1"

typedef struct {
    double J;     /* default 1.0 */
    double delta; /* default 0.9 */
} heisenberg_plane_params;

extern const heisenberg_plane_params heisenberg_plane_default_params;

enum { heisenberg_plane_ARRAYS = 3 };        /* arrays over the sites: fields, then parameters */
enum { heisenberg_plane_COEFFICIENTS = 52 }; /* numbers that depend on params and h only */

typedef enum { heisenberg_plane_OK = 0, heisenberg_plane_NO_CONVERGENCE, heisenberg_plane_SINGULAR,
    heisenberg_plane_NOT_FINITE, heisenberg_plane_BAD_ARGUMENT } heisenberg_plane_status;

/* The state is kept in memory of the caller.
   A field is many rows: a row is all sites along the last axis, with copies of the other end beside them.
   Set it up with heisenberg_plane_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[heisenberg_plane_AXES];
    size_t sites, rows;
    ptrdiff_t length, width; /* sites of a row; doubles between the beginnings of two rows */
    /* in rows, each field, then each parameter at sites: the first site of the first row */
    double *x[heisenberg_plane_ARRAYS];
    ptrdiff_t *lines; /* of each row, where it is and where those beside it are */
    double *before[heisenberg_plane_DIM]; /* the fields before the steps that are being made */
    int open; /* whether these lack the last flow of a step, which between calls x has made */
    size_t far; /* steps to be made by functions for large arguments, where there are others */
    size_t steps; /* good steps since heisenberg_plane_init */
    double t; /* time since heisenberg_plane_init */
    double h; /* the last step size */
    heisenberg_plane_params params;
    double coef[heisenberg_plane_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared; /* whether coef has been computed */
    size_t steps_before_h; /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} heisenberg_plane_solver;

/* The bytes that the solver of a lattice needs as its memory; 0 for sizes that are not allowed. */
size_t heisenberg_plane_work_size(const size_t sizes[heisenberg_plane_AXES]);

/* Start at x0[field][site], the last axis fastest, with heisenberg_plane_work_size(sizes) bytes of memory, as
   from malloc, which must stay. params may be NULL for the defaults; its arrays are copied.
   heisenberg_plane_BAD_ARGUMENT if sizes are not allowed, x0 or a parameter is not finite, or one that has to
   be positive is not. */
heisenberg_plane_status heisenberg_plane_init(heisenberg_plane_solver *s,
    const heisenberg_plane_params *params, const size_t sizes[heisenberg_plane_AXES], const double *x0,
    void *work);

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good
   ones. Steps are joined, also those of several calls: where one ends as the next begins, both are one flow.
   With OpenMP rows are worked at in parallel, with the same bits for any number of threads. */
heisenberg_plane_status heisenberg_plane_step(heisenberg_plane_solver *s, double h);
heisenberg_plane_status heisenberg_plane_integrate(heisenberg_plane_solver *s, double h, size_t steps);

/* The state x[field][site]. */
void heisenberg_plane_state(const heisenberg_plane_solver *s, double *x);

/* To go on elsewhere with the same bits: if heisenberg_plane_saved is 1, x is what the next step begins with,
   for heisenberg_plane_resume after heisenberg_plane_init at the state. If it is 0, heisenberg_plane_resume
   has NULL for x. */
int heisenberg_plane_saved(const heisenberg_plane_solver *s, double *x, size_t *far);
heisenberg_plane_status heisenberg_plane_resume(heisenberg_plane_solver *s, double h, const double *x,
    size_t far);

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double heisenberg_plane_hamiltonian(const heisenberg_plane_solver *s);
void heisenberg_plane_density(const heisenberg_plane_solver *s, double *out);
void heisenberg_plane_casimirs(const heisenberg_plane_solver *s, double *out);
void heisenberg_plane_vector_field(const heisenberg_plane_solver *s, double *out);

const char *heisenberg_plane_status_string(heisenberg_plane_status status);

/* For bindings: the size of heisenberg_plane_solver, and its count of good steps. */
size_t heisenberg_plane_solver_size(void);
size_t heisenberg_plane_solver_steps_done(const heisenberg_plane_solver *s);

#ifdef __cplusplus
}
#endif
#endif /* HEISENBERG_PLANE_H */
