#ifndef PHI_FILE_LATTICE_H
#define PHI_FILE_LATTICE_H
#include "declarations.h"
#include "phrases.h"
#include "status.h"

#include "lattice_predictor.h"

/* A solver, initialised by phi_init. Its arrays lie in memory of the caller, so a copy is no independent solver. Fields
   are stored in rows along the last axis. If steps read neighbours, a row has a halo: beside each end, copies of the
   sites at the opposite end. Callers may only read the struct. */
typedef struct {
#include "state_of_lattice.h"
} phi_solver;

#include "lattice_graph.h"
#include "lattice_grid.h"

/* As phi_init, at the time t0; phi_init starts at the time 0. */
phi_status phi_init_at(phi_solver *s, const phi_params *params, PHI_SIZES, const double *x0, double t0, void *work);

/* Select the random numbers of the next steps: a function of seed, ensemble member, number of the step (`step` for the
   next, below 2^48) and site. phi_init sets seed, member and step to 0. */
phi_status phi_set_noise(phi_solver *s, uint64_t seed, uint32_t member, uint64_t step);

/* Declare that this lattice is a part of a larger one with `planes` planes along the first axis, and that plane 0 of
   this lattice is plane number `first` of the larger one. Sites then have the random numbers that they have in the
   larger lattice. */
phi_status phi_set_planes(phi_solver *s, size_t first, size_t planes);

/* Set the number of earlier steps of size h, on which time and random numbers depend. Call it before each caller-driven
   step, and after phi_init to continue a run with the same bits. */
phi_status phi_passed(phi_solver *s, double h, size_t steps);

#if PHI_SERIES || PHI_NOISE
/* Make one step, or many, of size h, which may be negative. If a step fails, the state before it is kept, and s->steps
   counts the successful steps. With OpenMP, threads share the sites; the number of threads does not change results. */
#elif PHI_CORRECTED
/* Make one step, or many, of size h, which may be negative. If a step fails, the state before it is kept, and s->steps
   counts the successful steps. Each call begins and ends with the flows of the corrector. With OpenMP,
   threads share the sites; the number of threads does not change results. */
#else
/* Make one step, or many, of size h, which may be negative. If a step fails, the state before it is kept, and s->steps
   counts the successful steps. The last flow of a step is merged with the first of the next step or call. With
   OpenMP, threads share the sites; the number of threads does not change results. */
#endif
phi_status phi_step(phi_solver *s, double h);
phi_status phi_integrate(phi_solver *s, double h, size_t steps);

/* Make one step, or many, and multiply the tangent vectors v[vector][field][site] by the derivative of these steps,
   exact to round-off. `count` is the number of vectors, `work` is memory of phi_tangent_size(s, count) bytes. If a step
   fails, v is unchanged. */
size_t phi_tangent_size(const phi_solver *s, size_t count);
phi_status phi_step_tangent(phi_solver *s, double h, size_t count, double *v, void *work);
phi_status phi_integrate_tangent(phi_solver *s, double h, size_t steps, size_t count, double *v, void *work);

/* Make many steps as phi_integrate does, and their reverse pass (vector-Jacobian product). rows[row][field][site], if
   not NULL, receives the states after stride, 2 * stride, ... steps and at the end. For L = sum of rows_bar * rows,
   x0_bar[field][site] receives the derivatives of L by the initial state. The derivatives of L by the parameters are
   added to *params_bar, if params_bar is not NULL; its arrays have a number for each site or bond, or are NULL.
   Derivatives are exact to round-off. `trail` is work space of `size` bytes, at least phi_trail_size(s, 1). With
   phi_trail_size(s, steps) bytes, each step is computed once; with less, `steps` are computed again from stored states,
   most of them once more. On failure all arguments are unchanged. */
size_t phi_trail_size(const phi_solver *s, size_t steps);
phi_status phi_pullback(phi_solver *s, double h, size_t steps, size_t stride, double *rows, const double *rows_bar,
    double *x0_bar, phi_params_bar *params_bar, void *trail, size_t size);

/* Set a function that phi_pullback calls from time to time, or NULL for none. If the function does not return 0,
   phi_pullback stops and returns PHI_STOPPED. */
void phi_ask(phi_solver *s, int (*stop)(void));

/* phi_pullback for one step; `trail` has phi_trail_size(s, 1) bytes, and x0_bar may be x1_bar. */
phi_status phi_step_adjoint(phi_solver *s, double h, const double *x1_bar, double *x0_bar, phi_params_bar *params_bar,
    void *trail);

/* Copy the state to x[field][site]. */
void phi_state(const phi_solver *s, double *x);

/* Between steps: replace the state by x[field][site], or add change[field][site] to it. Returns PHI_BAD_ARGUMENT and
   leaves the state unchanged if the new state is not finite. */
phi_status phi_set_state(phi_solver *s, const double *x);
phi_status phi_kick(phi_solver *s, const double *change);

#if PHI_BODIES || PHI_MONITOR
/* Between steps: replace the parameters; the state and the time remain. params must not be NULL; NULL for one of its
   arrays means the default values. Returns PHI_BAD_ARGUMENT for parameters that phi_init refuses. If it refuses them
   because of the state or of masses, they are replaced nevertheless; then replace them again before the next step. */
#else
/* Between steps: replace the parameters; the state and the time remain. params must not be NULL; NULL for one of its
   arrays means the default values. Returns PHI_BAD_ARGUMENT for parameters that phi_init refuses, and then changes
   nothing. */
#endif
phi_status phi_set_parameters(phi_solver *s, const phi_params *params);

/* Save a run, and restore it so that it continues with the same bits. phi_saved writes *full_range and
   x[array][site], and returns the number of arrays: at most PHI_DIM, or 3 PHI_DIM with compensated steps. phi_resume
   takes these values, after phi_init. */
size_t phi_saved(const phi_solver *s, double *x, size_t *full_range);
phi_status phi_resume(phi_solver *s, double h, const double *x, size_t fields, size_t full_range);

/* The physical time since phi_init, also s->t. Steps are equal in a time tau: h is a step in tau of the Hamiltonian K =
   log(A + e) - log(-B), where H = A + B. K is 0 along the trajectory, since e = -H is set by phi_init and by changes of
   the state. These functions return PHI_BAD_ARGUMENT where -B is not positive. */
double phi_solver_time(const phi_solver *s);

/* Save and restore e and the physical time. To restore a run, call phi_resume, then phi_resume_clock. */
void phi_saved_clock(const phi_solver *s, double clock[5]);
phi_status phi_resume_clock(phi_solver *s, const double clock[5]);

/* Functions of the present state: the Hamiltonian; its density out[site]; the densities out[k][site] of the Casimirs;
   the right-hand side out[field][site] of the equations of motion. */
double phi_hamiltonian(const phi_solver *s);
void phi_density(const phi_solver *s, double *out);
void phi_casimirs(const phi_solver *s, double *out);
void phi_vector_field(const phi_solver *s, double *out);

/* Compute the observables, in the order of phi_OBSERVABLES. Sums are compensated, and have the same bits for any number
   of threads. */
void phi_observables(const phi_solver *s, double *out);

/* Compute the observables with a value at each site, out[k][site], in the order of phi_OBSERVED_FIELDS. */
void phi_observed_fields(const phi_solver *s, double *out);

#include "lattice_by_hand.h"

const char *phi_status_string(phi_status status);

/* For other languages: the size of the struct in bytes, and its number of successful steps. */
size_t phi_solver_size(void);
size_t phi_solver_steps_done(const phi_solver *s);
#endif
