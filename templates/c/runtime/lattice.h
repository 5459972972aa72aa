#ifndef PHI_FILE_LATTICE_H
#define PHI_FILE_LATTICE_H
#include "declarations.h"
#include "phrases.h"
#include "status.h"

#if PHI_GUESSES
/* Predictor of the solution y of an implicit stage: backward differences of the last values of y - x, from which the
   starting value of the iteration is extrapolated. */
typedef struct {
    int count, order; /* number of differences that are known, and of those that the extrapolation sums */
    double *difference[PHI_DIFFERENCES][PHI_DIM];
} phi_guess;

#endif
/* A solver and the trajectory that it computes. Initialise it by phi_init. Its arrays lie in memory of the caller, so a
   copy of the struct is not an independent solver.
#if PHI_ONE_ROW && PHI_HALO
   A field is stored as one row of all sites, with a halo: copies of the sites of the other end beside each end.
#elif PHI_ONE_ROW
   A field is stored as one row of all sites.
#elif PHI_HALO
   A field is stored in rows. A row is all sites along the last axis, with a halo: copies of the sites of the other end
   beside each end.
#else
   A field is stored in rows. A row is all sites along the last axis.
#endif
   Read all fields of the struct at any time, write to none of them. */
typedef struct {
    size_t sizes[PHI_AXES];   /* number of sites along each axis */
    size_t sites, rows;       /* number of all sites, and of rows */
    ptrdiff_t length, width;  /* sites of a row; doubles from the start of a row to that of the next */
#if PHI_SEAMS
    ptrdiff_t seams[PHI_AXES]; /* first site along each axis whose colour breaks the period; the size if there is none */
    ptrdiff_t inside[2];      /* in a row, the first site away from the seam, and the site behind the last of them */
    double *kinds;            /* for each site, in rows: its colour, and the seams that it is on, as one number */
#endif
    double *x[PHI_ARRAYS];    /* the state: first site of each field, then of each parameter at sites, in rows */
#if !PHI_ONE_ROW
    ptrdiff_t *lines;         /* for each row: its offset, and the offsets of the rows beside it */
#endif
#if PHI_GATHER
    double *gathered[PHI_GATHERED]; /* for each site, sums over other sites */
#endif
#if PHI_GRAPH
    int *bonds, *middle;      /* for each site, index in other of its first bond that starts there, and that ends there */
    int *other, *number;      /* for each of these, the site at the other end, and the number of the bond */
#if PHI_BOND_PARAMETERS
    double *at_bonds[PHI_BOND_ARRAYS]; /* for each of these, the values of the parameters at bonds */
#endif
#if PHI_BY_COLOUR
    int *colours;             /* colour of each site; no bond connects two sites of the same colour */
    int colour_count, flows;  /* number of colours, and of flows in a stage */
#endif
#endif
#if PHI_SERIES
    double *before[PHI_DIM];  /* the fields at the start of the present steps, restored if a step fails */
#else
    double *before[PHI_DIM];  /* the fields at the start of the present steps, restored if a step fails */
#if PHI_COMPENSATED
    double *carry[2 * PHI_DIM]; /* compensation terms of the fields, then of before */
#endif
    int open;                 /* 1 if before lacks the last flow of the last step, which x includes between calls */
    size_t far;               /* steps that use functions for arguments of any size in place of faster ones for small */
#if PHI_BY_HAND && PHI_ONE_ROW
    ptrdiff_t from, to;       /* the sites of the present sweep */
#endif
#endif
#if PHI_SERIES
#if PHI_ADJOINT
    double *y[3][PHI_ARRAYS]; /* solution of a stage before and after a sweep, and in the reverse pass; parameters at sites */
    double *const *side;      /* right-hand side while the equation of the cotangents is solved, else NULL */
    double *const *handed, *shares; /* cotangents for neighbouring sites; for each row segment, its terms of sums */
    int wide;                 /* 1 if the cotangents use functions for arguments of any size */
#elif PHI_SLOPES
    double *y[2][PHI_ARRAYS]; /* solution of a stage before and after a sweep, with the parameters at sites */
#else
    double *y[3][PHI_ARRAYS]; /* solution of a stage before and after a sweep, and perturbed; with the parameters at sites */
#endif
#if PHI_GUESSES
    phi_guess PHI_OF(guess, PHI_STAGES); /* predictor of each stage */
#endif
    size_t sweeps;            /* number of sweeps of all stages since phi_init */
    int stiff;                /* 1 if fixed-point sweeps have failed, so that Newton's method is used */
    double usual[PHI_DIM];    /* magnitudes of the fields of y */
#if PHI_BANDED
    const double *factored;   /* the coefficients of the factorised matrix, or NULL */
    double *v[PHI_DIM];       /* a direction of Newton's method */
    double *matrix;           /* the factorised band matrix, see phi_factorise */
#endif
#if PHI_KRYLOV
#if PHI_SITE_BLOCKS
    double *block[PHI_DIM * PHI_DIM], *solved[PHI_DIM]; /* preconditioner: inverses of the diagonal blocks; their products */
#endif
    double *space[PHI_DIRECTIONS + 1][PHI_DIM], *sums; /* basis of the Krylov space, sums over row segments: see phi_krylov */
#endif
#endif
    size_t steps;             /* number of successful steps since phi_init */
#if PHI_TIMED
    double t;                 /* the time of the state */
    double now;               /* the time of the present stage, at which H is evaluated */
#else
    double t;                 /* time since phi_init */
#endif
    double h;                 /* size of the last step */
#if PHI_NOISE
    uint64_t seed, first_step; /* seed of the noise, and number of the first step after phi_init: see phi_set_noise */
    uint32_t member;
#if PHI_BY_HAND
    uint64_t first_plane, planes; /* number of the first plane in the whole lattice, and its number of planes, or 0 */
#endif
#endif
#if PHI_ADJOINT
    int (*stop)(void);        /* see phi_ask */
#if PHI_SERIES
    double *kept;             /* tape to which a step writes the solutions of its stages, or NULL */
#elif !PHI_UNDONE
    double *kept;             /* tape to which steps write the values that their sweeps overwrite, or NULL */
#endif
#endif
#if PHI_TANGENT
    size_t vectors;           /* number of tangent vectors that flows act on */
    double *tangents;         /* the fields of the first vector, in rows, then those of the others */
#endif
    phi_params params;        /* the parameters, set by phi_init */
    double coef[PHI_COEFFICIENTS]; /* functions of params and h */
    int prepared;             /* 1 if coef has been computed */
    size_t steps_before_h;    /* steps and t at the last change of h: t = t_before_h + (steps since then) h */
    double t_before_h;
} phi_solver;

#if PHI_GRAPH
/* The bonds of a graph. Bond k connects the sites ends[2 * k] and ends[2 * k + 1], which are counted from 0. */
typedef struct {
    size_t count;
    const size_t *ends;
} phi_bonds;

/* Return the number of bytes that phi_init needs as memory for these sizes and number of bonds, 0 if there are too many. */
size_t phi_work_size(const size_t sizes[PHI_AXES], size_t bonds);

/* Initialise *s with the state x0[field][site]. work is memory of phi_work_size(sizes, bonds->count) bytes, aligned as by
   malloc; the caller frees it after the last use of *s. bonds may be NULL if there are none, params for the defaults; all
   arrays are copied. Returns PHI_BAD_ARGUMENT if sizes are not admissible, if a bond does not connect two different sites,
   if x0 or a parameter is not finite, or if a parameter that must be positive is not. */
phi_status phi_init(phi_solver *s, const phi_params *params, const size_t sizes[PHI_AXES], const phi_bonds *bonds,
    const double *x0, void *work);
#if PHI_TIMED

/* The same at the time t0; phi_init starts at the time 0. */
phi_status phi_init_at(phi_solver *s, const phi_params *params, const size_t sizes[PHI_AXES], const phi_bonds *bonds,
    const double *x0, double t0, void *work);
#endif
#else
/* Return the number of bytes that phi_init needs as memory for these sizes, 0 for sizes that are not admissible. */
size_t phi_work_size(const size_t sizes[PHI_AXES]);

/* Initialise *s with the state x0[field][site], where the site index of the last axis varies fastest. work is memory of
   phi_work_size(sizes) bytes, aligned as by malloc; the caller frees it after the last use of *s. params may be NULL for
   the defaults; its arrays are copied. Returns PHI_BAD_ARGUMENT if sizes are not admissible, if x0 or a parameter is not
   finite, or if a parameter that must be positive is not. */
phi_status phi_init(phi_solver *s, const phi_params *params, const size_t sizes[PHI_AXES], const double *x0, void *work);
#if PHI_TIMED

/* The same at the time t0; phi_init starts at the time 0. */
phi_status phi_init_at(
    phi_solver *s, const phi_params *params, const size_t sizes[PHI_AXES], const double *x0, double t0, void *work);
#endif
#endif
#if PHI_NOISE

/* Select the random numbers of the next steps. They are a function of the seed, the member of an ensemble, the number of
   the step, which must be less than 2^48, and the site. phi_init sets the first three to 0. */
phi_status phi_set_noise(phi_solver *s, uint64_t seed, uint32_t member, uint64_t step);
#if PHI_BY_HAND

/* Declare that this lattice is a part of one with planes planes along the first axis, and that the first plane here is
   number first of it. So sites have the random numbers that they have in the whole lattice. */
phi_status phi_set_planes(phi_solver *s, size_t first, size_t planes);
#endif
#endif
#if PHI_TIMED || PHI_NOISE

/* Advance time and random numbers by steps steps of size h. Call it after phi_init to continue a run with the same bits,
   and before each step of caller-driven stepping. */
phi_status phi_passed(phi_solver *s, double h, size_t steps);
#endif

/* Make one step, or many, of size h, which may be negative. If a step fails, the state is that before the step, and
   s->steps counts the successful ones.
#if PHI_GUESSES
   Predictors are extrapolated from earlier steps of the same call.
#elif !PHI_SERIES
   The last flow of a step is merged with the first of the next, also of the next call.
#endif
   With OpenMP, rows are updated in parallel, with the same bits for any number of threads. */
phi_status phi_step(phi_solver *s, double h);
phi_status phi_integrate(phi_solver *s, double h, size_t steps);

#if PHI_TANGENT
/* Make one step, or many, and multiply the tangent vectors v[vector][field][site] by their derivatives, exact to
   round-off. count is the number of vectors, work is memory of phi_tangent_size(s, count) bytes. If a step fails, v is
   unchanged. */
size_t phi_tangent_size(const phi_solver *s, size_t count);
phi_status phi_step_tangent(phi_solver *s, double h, size_t count, double *v, void *work);
phi_status phi_integrate_tangent(phi_solver *s, double h, size_t steps, size_t count, double *v, void *work);

#endif
#if PHI_ADJOINT
/* Make many steps as phi_integrate does, and their reverse pass (vector-Jacobian product). rows[row][field][site], if not
   NULL, receives the states after stride, 2 * stride, ... steps and at the end. For L = sum of rows_bar * rows,
   x0_bar[field][site] receives the derivatives of L by the initial state, and those by the parameters are added to
   *params_bar, if not NULL; its arrays have a number for each site or bond, or are NULL. Derivatives are exact to
   round-off. trail is work space of size bytes, at least phi_trail_size(s, 1). With phi_trail_size(s, steps) bytes, each
   step is computed once. With less, steps are recomputed from stored states, most of them once. On failure all arguments
   are unchanged. */
size_t phi_trail_size(const phi_solver *s, size_t steps);
phi_status phi_pullback(phi_solver *s, double h, size_t steps, size_t stride, double *rows, const double *rows_bar,
    double *x0_bar, phi_params_bar *params_bar, void *trail, size_t size);

/* Set a function that phi_pullback calls from time to time; if it does not return 0, phi_pullback returns PHI_STOPPED.
   NULL for none. */
void phi_ask(phi_solver *s, int (*stop)(void));

/* The same for one step; trail has phi_trail_size(s, 1) bytes, and x0_bar may be x1_bar. */
phi_status phi_step_adjoint(phi_solver *s, double h, const double *x1_bar, double *x0_bar, phi_params_bar *params_bar,
    void *trail);

#endif
/* Copy the state to x[field][site]. */
void phi_state(const phi_solver *s, double *x);
#if PHI_KICKED

/* Between steps: replace the state by x[field][site], or add change[field][site] to it. Returns PHI_BAD_ARGUMENT and leaves
   the state unchanged if the new state is not finite. */
phi_status phi_set_state(phi_solver *s, const double *x);
phi_status phi_kick(phi_solver *s, const double *change);
#endif
#if !PHI_SERIES && !PHI_NOISE || !PHI_SERIES && PHI_NEAR

#if PHI_COMPENSATED
/* Save and restore a run with the same bits. phi_saved writes x and far. To restore, call phi_init with the state, then
   phi_resume with far, and with x if phi_saved returned 1, else NULL. x has room for two states: all fields, then the
   compensation term of each. */
#else
/* Save and restore a run with the same bits. phi_saved writes x[field][site] and far. To restore, call phi_init with the
   state, then phi_resume with far, and with x if phi_saved returned 1, else NULL. */
#endif
int phi_saved(const phi_solver *s, double *x, size_t *far);
phi_status phi_resume(phi_solver *s, double h, const double *x, size_t far);
#endif

/* Functions of the present state: the Hamiltonian; its density out[site]; the densities out[k][site] of the Casimirs; the
   right-hand side out[field][site] of the equations of motion. */
double phi_hamiltonian(const phi_solver *s);
void phi_density(const phi_solver *s, double *out);
void phi_casimirs(const phi_solver *s, double *out);
void phi_vector_field(const phi_solver *s, double *out);

#if PHI_OBSERVED
/* The observables, in the order of phi_OBSERVABLES. Sums are compensated, with the same bits for any number of threads. */
void phi_observables(const phi_solver *s, double *out);

#endif
#if PHI_OBSERVED_FIELDS
/* The observables with a value at each site, as out[k][site], in the order of phi_OBSERVED_FIELDS. */
void phi_observed_fields(const phi_solver *s, double *out);

#endif
#if PHI_BY_HAND
/* Caller-driven stepping, for lattices distributed over several memories. A plane is all sites with the same index of the
   first axis. A step consists of the stages 0 ... phi_stages() - 1; each is a sweep over all planes. Without noise, stage
   number phi_stages() is the last stage of a step merged with the first of the next, as in phi_integrate. A stage may be
   made in parts, in any order, with the same bits as phi_step. Before a part is swept, all planes that it reads must have
   completed the stages before. */
typedef struct {
    size_t behind, ahead;        /* number of planes read before the first swept one, and after the last */
    unsigned long read, changed; /* fields that are read there, and fields that are changed; bit k is field k */
} phi_stage;

size_t phi_stages(void);
phi_status phi_describe(size_t number, phi_stage *about);

/* phi_begin computes the coefficients for a step size; call it before the first stage. phi_sweep makes a stage for the
   planes from ... to - 1. With far = 1 it uses functions for arguments of any size; with far = 0 faster ones, which give
   NaN if an argument is too large. */
phi_status phi_begin(phi_solver *s, double h);
phi_status phi_sweep(phi_solver *s, size_t number, int far, size_t from, size_t to);

/* Read or write the values x[plane][site] of a field, counted from 0, on the planes from ... to - 1. phi_holds returns 1 if
   all fields are finite on these planes. */
phi_status phi_planes(const phi_solver *s, size_t field, size_t from, size_t to, double *x);
phi_status phi_put_planes(phi_solver *s, size_t field, size_t from, size_t to, const double *x);
int phi_holds(const phi_solver *s, size_t from, size_t to);

#endif
const char *phi_status_string(phi_status status);

/* For other languages, which cannot read the struct: its size in bytes, and its number of successful steps. */
size_t phi_solver_size(void);
size_t phi_solver_steps_done(const phi_solver *s);
#endif
