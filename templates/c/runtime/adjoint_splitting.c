#ifndef PHI_FILE_ADJOINT_SPLITTING
#define PHI_FILE_ADJOINT_SPLITTING
#include <float.h>
#include <math.h>
#include <string.h>
#include "adjoint_stage.c"
#include "adjoint_flows.h"

/* Pull a cotangent back through a step whose flows began at y. */
static phi_status phi_stage_adjoint(const double *coef, phi_kept y, phi_cotangent *bar,
    double coef_bar[PHI_COEFFICIENTS])
{
    for (int k = PHI_FLOWS - 1; k >= 0; --k) {
        const int row = phi_flow_row[k] * PHI_ROW;
        phi_follow_back(phi_flow_part[k], coef + row, y[k], bar->x, coef_bar + row);
    }
    return PHI_OK;
}
#endif
