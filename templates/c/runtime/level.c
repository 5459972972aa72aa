#ifndef PHI_FILE_LEVEL
#define PHI_FILE_LEVEL
#include "model.h"

/* ---- What a monitored trajectory holds fixed: e = -H(x0), so that K = monitor (H + e) is 0 along it ---- */
static void phi_choose_gauge(const phi_params *params, const double x[PHI_DIM], double gauge[PHI_GAUGES])
{
    gauge[0] = -phi_hamiltonian(params, x);
}
#endif
