#ifndef PHI_FILE_LEVEL
#define PHI_FILE_LEVEL
#include <math.h>

#include "model.h"

/* ---- The energy level e = -H(x0), a constant of a trajectory, and the monitor dt/dtau ---- */
static void phi_choose_gauge(const phi_params *params, const double x[PHI_DIM], double gauge[PHI_GAUGES])
{
    gauge[0] = -phi_hamiltonian(params, x);
}

/* Whether the monitor is positive and finite at a state, so that the physical time increases with tau. */
static int phi_time_passes(const phi_params *params, const double x[PHI_DIM])
{
    const double rate = phi_monitor(params, x);
    return isfinite(rate) && rate > 0.0;
}

/* Convert a vector field from dx/dt to dx/dtau, where t is the physical time. */
static void phi_make_per_tau(const phi_params *params, const double x[PHI_DIM], double field[PHI_DIM])
{
    const double rate = phi_monitor(params, x);
    for (int i = 0; i < PHI_DIM; ++i) field[i] *= rate;
}
#endif
