#ifndef PHI_FILE_DEVICE_SOLVER_H
#define PHI_FILE_DEVICE_SOLVER_H
#include "history_gauss.h"
#include "device_history.h"

/* A solver in the memory of one work item. Other kernels may call the functions below. */
typedef struct {
#include "state_members.h"
} phi_solver;

/* Initialise *s with the state x0. Returns PHI_BAD_ARGUMENT, with *s unchanged, if a value or a coefficient is not finite, or if a
   parameter that must be positive is not. */
phi_status phi_init(phi_solver *s, const phi_params *params, const double x0[PHI_DIM]);

/* As phi_init, at the time t0; phi_init starts at the time 0. */
phi_status phi_init_at(phi_solver *s, const phi_params *params, const double x0[PHI_DIM], double t0);

/* As phi_init, but the caller chooses the PHI_GAUGES numbers in gauge; phi_init chooses them at x0. */
phi_status phi_init_gauge(phi_solver *s, const phi_params *params, const double x0[PHI_DIM],
    const double gauge[PHI_GAUGES]);

/* Make steps of size h, which may be negative. If a step fails, s->x and s->steps remain those
   before this step. */
phi_status phi_integrate(phi_solver *s, double h, size_t steps);

/* As phi_integrate, with given increments of the noise: dw[k * PHI_DRAWS + i] is increment i of step k. NULL for random
   increments. */
phi_status phi_integrate_along(phi_solver *s, double h, size_t steps, const double *dw);

/* Select the random numbers of the next steps. They are a function of seed, member and number of the step, which is
   `step` for the next step; phi_init sets seed, member and step to 0. */
phi_status phi_set_noise(phi_solver *s, uint64_t seed, uint32_t member, uint64_t step);
#endif
