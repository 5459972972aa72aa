#ifndef PHI_FILE_LATTICE_H
#define PHI_FILE_LATTICE_H
#include "declarations.h"
#include "phrases.h"
#include "status.h"

#if PHI_GUESSES
/* What guesses for the y of a stage are extrapolated from: differences of the last values of y - x. */
typedef struct {
    int count, order; /* differences that there are, and that the next guess takes */
    double *difference[PHI_DIFFERENCES][PHI_DIM];
} phi_guess;

#endif
/* The state is kept in memory of the caller.
#if PHI_ONE_ROW && PHI_HALO
   A field is a row: all its sites, with copies of the other end beside them.
#elif PHI_ONE_ROW
   A field is a row: all its sites.
#elif PHI_HALO
   A field is many rows: a row is all sites along the last axis, with copies of the other end beside them.
#else
   A field is many rows: a row is all sites along the last axis.
#endif
   Set it up with phi_init; a copy of the struct is the same solver, not another one. */
typedef struct {
    size_t sizes[PHI_AXES];
    size_t sites, rows;
    ptrdiff_t length, width;  /* sites of a row; doubles between the beginnings of two rows */
#if PHI_SEAMS
    ptrdiff_t seams[PHI_AXES]; /* along each axis the first site of the seam; that behind the last where there is none */
    ptrdiff_t inside[2];      /* of a row the first site away from the seam, and that behind the last */
    double *kinds;            /* of each site, in rows: its colour, and the seams that it is on */
#endif
    double *x[PHI_ARRAYS];    /* in rows, each field, then each parameter at sites: the first site of the first row */
#if !PHI_ONE_ROW
    ptrdiff_t *lines;         /* of each row, where it is and where those beside it are */
#endif
#if PHI_GATHER
    double *gathered[PHI_GATHERED]; /* sums over other sites, for each site */
#endif
#if PHI_GRAPH
    int *bonds, *middle;      /* of each site the first of its bonds that begin there, then of those that end there */
    int *other, *number;      /* of each of these the site at the other end, and the number of the bond */
#if PHI_BOND_PARAMETERS
    double *at_bonds[PHI_BOND_ARRAYS]; /* the values of each parameter at these */
#endif
#if PHI_BY_COLOUR
    int *colours;             /* of each site; no bond connects two sites of one colour */
    int colour_count, flows;  /* colours, and flows from one end of a stage to the other */
#endif
#endif
#if PHI_SERIES
    double *before[PHI_DIM];  /* the fields before the steps that are being made */
#else
    double *before[PHI_DIM];  /* the fields before the steps that are being made */
#if PHI_COMPENSATED
    double *carry[2 * PHI_DIM]; /* what rounding has left out of the fields, and of those before */
#endif
    int open;                 /* whether these lack the last flow of a step, which between calls x has made */
    size_t far;               /* steps to be made by functions for large arguments, where there are others */
#if PHI_BY_HAND && PHI_ONE_ROW
    ptrdiff_t from, to;       /* the sites that are swept */
#endif
#endif
#if PHI_SERIES
#if PHI_ADJOINT
    double *y[3][PHI_ARRAYS]; /* the middle of a stage, before and after a sweep, with the parameters at sites; of one gone back through */
    double *const *side;      /* while the equation of its cotangents is solved, what is on the right of it, else NULL */
    double *const *handed, *shares; /* what sites hand to those that they have read; of each piece of a row shares in sums */
    int wide;                 /* whether they are found by functions for arguments of any size */
#elif PHI_SLOPES
    double *y[2][PHI_ARRAYS]; /* the middle of a stage, before and after a sweep, with the parameters at sites */
#else
    double *y[3][PHI_ARRAYS]; /* the middle of a stage, before and after a sweep, and varied; with the parameters at sites */
#endif
#if PHI_GUESSES
    phi_guess PHI_OF(guess, PHI_STAGES);
#endif
    size_t sweeps;            /* that stages took since phi_init */
    int stiff;                /* whether sweeps have failed */
    double usual[PHI_DIM];    /* the sizes of the fields of y */
#if PHI_BANDED
    const double *factored;   /* the coefficients that the matrix is of, or NULL */
    double *v[PHI_DIM];       /* a variation of y */
    double *matrix;           /* see phi_factorise */
#endif
#if PHI_KRYLOV
#if PHI_SITE_BLOCKS
    double *block[PHI_DIM * PHI_DIM], *solved[PHI_DIM]; /* inverses of the matrix at the sites themselves; their products */
#endif
    double *space[PHI_DIRECTIONS + 1][PHI_DIM], *sums; /* variations of y, sums over pieces: see phi_krylov */
#endif
#endif
    size_t steps;             /* good steps since phi_init */
#if PHI_TIMED
    double t;                 /* the time of the state */
    double now;               /* the time that kernels see: t, but for the middle of a stage */
#else
    double t;                 /* time since phi_init */
#endif
    double h;                 /* the last step size */
#if PHI_NOISE
    uint64_t seed, first_step; /* of the noise: its seed, and the number of the step after phi_init */
    uint32_t member;
#if PHI_BY_HAND
    uint64_t first_plane, planes; /* of the whole lattice: the plane that is here the first, and how many there are; or 0 */
#endif
#endif
#if PHI_ADJOINT
    int (*stop)(void);        /* see phi_ask */
#if PHI_SERIES
    double *kept;             /* where a step keeps the y of its stages, while it does */
#elif !PHI_UNDONE
    double *kept;             /* where steps keep what the sweeps of them change, while they do */
#endif
#endif
#if PHI_TANGENT
    size_t vectors;           /* tangent vectors that flows carry along, while they do */
    double *tangents;         /* the fields of the first, in rows, then those of the others */
#endif
    phi_params params;
    double coef[PHI_COEFFICIENTS]; /* all that depends on params and h only */
    int prepared;             /* whether coef has been computed */
    size_t steps_before_h;    /* steps and t when h was set: t is counted from there, so no error adds up */
    double t_before_h;
} phi_solver;

#if PHI_GRAPH
/* The bonds of a graph: number k runs from site ends[2 * k] to another, ends[2 * k + 1], counted from 0. */
typedef struct {
    size_t count;
    const size_t *ends;
} phi_bonds;

/* The bytes that the solver of a graph with so many sites and bonds needs as memory; 0 for too many. */
size_t phi_work_size(const size_t sizes[PHI_AXES], size_t bonds);

/* Start at x0[field][site], with phi_work_size(sizes, bonds->count) bytes of memory, as from malloc, which must stay.
   bonds may be NULL if there are none, params for the defaults; all arrays are copied. PHI_BAD_ARGUMENT if sizes are not
   allowed, a bond does not run between two different sites, x0 or a parameter is not finite, or one that has to be
   positive is not. */
phi_status phi_init(phi_solver *s, const phi_params *params, const size_t sizes[PHI_AXES], const phi_bonds *bonds,
    const double *x0, void *work);
#if PHI_TIMED

/* The same at the time t0, which for phi_init is 0. */
phi_status phi_init_at(phi_solver *s, const phi_params *params, const size_t sizes[PHI_AXES], const phi_bonds *bonds,
    const double *x0, double t0, void *work);
#endif
#else
/* The bytes that the solver of a lattice needs as its memory; 0 for sizes that are not allowed. */
size_t phi_work_size(const size_t sizes[PHI_AXES]);

/* Start at x0[field][site], the last axis fastest, with phi_work_size(sizes) bytes of memory, as from malloc, which must stay. params
   may be NULL for the defaults; its arrays are copied. PHI_BAD_ARGUMENT if sizes are not allowed, x0 or a parameter is
   not finite, or one that has to be positive is not. */
phi_status phi_init(phi_solver *s, const phi_params *params, const size_t sizes[PHI_AXES], const double *x0, void *work);
#if PHI_TIMED

/* The same at the time t0, which for phi_init is 0. */
phi_status phi_init_at(
    phi_solver *s, const phi_params *params, const size_t sizes[PHI_AXES], const double *x0, double t0, void *work);
#endif
#endif
#if PHI_NOISE

/* Which random numbers the next step takes, which all sites have of their own: those of a seed, of a member of an ensemble,
   and of the number of a step, below 2^48; all are 0 before. */
phi_status phi_set_noise(phi_solver *s, uint64_t seed, uint32_t member, uint64_t step);
#if PHI_BY_HAND

/* That this is a part of a lattice of so many planes along the first axis, where the plane that is the first here has the number
   first: so its sites have the random numbers that they have there. */
phi_status phi_set_planes(phi_solver *s, size_t first, size_t planes);
#endif
#endif
#if PHI_TIMED || PHI_NOISE

/* Say that so many steps of size h have led to the state since phi_init: to go on elsewhere with the same bits, and before each
   step that is made by hand. */
phi_status phi_passed(phi_solver *s, double h, size_t steps);
#endif

/* Steps of size h, of either sign. If one fails, the state is that before it, and s->steps counts the good ones.
#if PHI_GUESSES
   Guesses are extrapolated from the former steps of one call.
#elif !PHI_SERIES
   Steps are joined, also those of several calls: where one ends as the next begins, both are one flow.
#endif
   With OpenMP rows are worked at in parallel, with the same bits for any number of threads. */
phi_status phi_step(phi_solver *s, double h);
phi_status phi_integrate(phi_solver *s, double h, size_t steps);

#if PHI_TANGENT
/* Steps, and where their derivatives carry so many tangent vectors v[vector][field][site], which are overwritten: exact to
   round-off. They need phi_tangent_size(s, count) bytes of memory besides. If a step fails, v is as before all of them. */
size_t phi_tangent_size(const phi_solver *s, size_t count);
phi_status phi_step_tangent(phi_solver *s, double h, size_t count, double *v, void *work);
phi_status phi_integrate_tangent(phi_solver *s, double h, size_t steps, size_t count, double *v, void *work);

#endif
#if PHI_ADJOINT
/* Many steps as phi_integrate makes them from the state, and the transpose of their derivative: rows[row][field][site], if not
   NULL, gets the states after stride, 2 * stride, ... steps and at the end, rows_bar are their cotangents. x0_bar[field][site]
   gets the derivatives of sum rows_bar * rows along the state before, and *params_bar, where not NULL, gains those along the
   parameters: its arrays have a number for each site, or bond, or are NULL. All is exact to round-off. trail is memory of so
   many bytes, phi_trail_size(s, steps) for any number of steps: with as many as there are, each is made once. With less
   they are made again, in pieces; more than for one step is room for states to begin these with, so that few are made
   more than twice. On failure all is as before. */
size_t phi_trail_size(const phi_solver *s, size_t steps);
phi_status phi_pullback(phi_solver *s, double h, size_t steps, size_t stride, double *rows, const double *rows_bar,
    double *x0_bar, phi_params_bar *params_bar, void *trail, size_t size);

/* Ask this now and then in phi_pullback, which ends with PHI_STOPPED where it is not 0, and nobody if it is NULL. */
void phi_ask(phi_solver *s, int (*stop)(void));

/* The same for one step, with phi_trail_size(s, 1) bytes; x0_bar may be x1_bar. */
phi_status phi_step_adjoint(phi_solver *s, double h, const double *x1_bar, double *x0_bar, phi_params_bar *params_bar,
    void *trail);

#endif
/* The state x[field][site]. */
void phi_state(const phi_solver *s, double *x);
#if PHI_KICKED

/* Between steps: stand at x, or move by change, both [field][site], all else being as it was, also on PHI_BAD_ARGUMENT. */
phi_status phi_set_state(phi_solver *s, const double *x);
phi_status phi_kick(phi_solver *s, const double *change);
#endif
#if !PHI_SERIES && !PHI_NOISE || !PHI_SERIES && PHI_NEAR

#if PHI_COMPENSATED
/* To go on elsewhere with the same bits: if phi_saved is 1, x is what the next step begins with, for phi_resume after
   phi_init at the state: all fields, then what rounding has left out of each. If it is 0, phi_resume has NULL for x. */
#else
/* To go on elsewhere with the same bits: if phi_saved is 1, x is what the next step begins with, for phi_resume after
   phi_init at the state. If it is 0, phi_resume has NULL for x. */
#endif
int phi_saved(const phi_solver *s, double *x, size_t *far);
phi_status phi_resume(phi_solver *s, double h, const double *x, size_t far);
#endif

/* The Hamiltonian; its density at each site; the densities out[k][site] of the Casimirs; the right-hand side
   out[field][site]. */
double phi_hamiltonian(const phi_solver *s);
void phi_density(const phi_solver *s, double *out);
void phi_casimirs(const phi_solver *s, double *out);
void phi_vector_field(const phi_solver *s, double *out);

#if PHI_OBSERVED
/* The observables, in the order of phi_OBSERVABLES. Sums are compensated, and the same for any number of threads. */
void phi_observables(const phi_solver *s, double *out);

#endif
#if PHI_OBSERVED_FIELDS
/* The observables out[k][site] that have a value at each site, in the order of phi_OBSERVED_FIELDS. */
void phi_observed_fields(const phi_solver *s, double *out);

#endif
#if PHI_BY_HAND
/* Steps by hand, for lattices that are distributed over several memories. A step is the stages 0, 1, ... before
   phi_stages(), each a sweep over all planes: the sites of one place along the first axis. Number phi_stages(), which with
   noise there is not, is the last stage of a step and the first of the next together, as phi_integrate does them. A stage
   may be made in any number of pieces, in any order, with the bits of phi_step; before that, the planes beside a piece
   that it reads must have made the stages before. */
typedef struct {
    size_t behind, ahead;        /* planes before the first one swept, and after the last one, that are read */
    unsigned long read, changed; /* fields that are read there, and those that are changed; bit k is field k */
} phi_stage;

size_t phi_stages(void);
phi_status phi_describe(size_t number, phi_stage *about);

/* What depends on the step size, before the first stage; and a stage for the planes from..to, to not among them. far:
   whether by functions for arguments of any size; without it, values that are not finite say that these were needed. */
phi_status phi_begin(phi_solver *s, double h);
phi_status phi_sweep(phi_solver *s, size_t number, int far, size_t from, size_t to);

/* Values x[plane of those from..to][sites of it] of a field, which is 0 for the first; putting them takes the place of what was
   there. phi_holds tells whether those of all fields there are finite. */
phi_status phi_planes(const phi_solver *s, size_t field, size_t from, size_t to, double *x);
phi_status phi_put_planes(phi_solver *s, size_t field, size_t from, size_t to, const double *x);
int phi_holds(const phi_solver *s, size_t from, size_t to);

#endif
const char *phi_status_string(phi_status status);

/* For bindings: the size of phi_solver, and its count of good steps. */
size_t phi_solver_size(void);
size_t phi_solver_steps_done(const phi_solver *s);
#endif
