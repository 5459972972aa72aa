#ifndef PHI_FILE_GAUGE_FORMULA
#define PHI_FILE_GAUGE_FORMULA
#include <float.h>
#include <math.h>
#include <string.h>

#include "model.h"

/* Compute for each Casimir C the factor c that minimises |grad H - c grad C| at x; 0 if c is not finite. */
static void phi_choose_gauge(const phi_params *params, const double x[PHI_DIM], double gauge[PHI_GAUGES])
{
    double out[1 + 2 * PHI_GAUGES];
    phi_products(params, x, out);
    for (int c = 0; c < PHI_GAUGES; ++c) {
        const double multiple = out[1 + 2 * c] / out[2 + 2 * c];
        gauge[c] = isfinite(multiple) ? multiple : 0.0;
    }
}
#endif
