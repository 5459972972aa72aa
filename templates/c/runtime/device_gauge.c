#ifndef PHI_FILE_DEVICE_GAUGE
#define PHI_FILE_DEVICE_GAUGE
#include "model.h"
#include "gauge_formula.c"
#include "level.c"

/* Copy the gauge of a member from global memory; NULL: choose it at the initial state x0. */
static void phi_gauge_of(const phi_params *params, const double x0[PHI_DIM], PHI_GLOBAL const double *gauge_of_member,
    double gauge[PHI_GAUGES])
{
    if (gauge_of_member == NULL) phi_choose_gauge(params, x0, gauge);
    for (int k = 0; k < PHI_GAUGES && gauge_of_member != NULL; ++k) gauge[k] = gauge_of_member[k];
}
#endif
