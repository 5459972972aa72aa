#ifndef PHI_FILE_DEVICE_GAUGE
#define PHI_FILE_DEVICE_GAUGE
#include "model.h"
#include "gauge_formula.c"
#include "level.c"

/* Gauge of a member; for NULL the gauge chosen at its initial state. */
static void phi_gauge_of(const phi_params *params, const double x0[PHI_DIM], PHI_GLOBAL const double *given,
    double gauge[PHI_GAUGES])
{
    if (given == NULL) phi_choose_gauge(params, x0, gauge);
    for (int k = 0; k < PHI_GAUGES && given != NULL; ++k) gauge[k] = given[k];
}
#endif
