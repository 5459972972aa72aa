#ifndef PHI_FILE_ADJOINT_SPLITTING
#define PHI_FILE_ADJOINT_SPLITTING
#include <float.h>
#include <math.h>
#include <string.h>
#include "adjoint_stage.c"
#include "adjoint_flows.h"

/* Pull a cotangent back through the flows number first ... last of a step, in reverse order. y has the state before
   each flow. */
static void phi_flows_back(const double *coef, phi_step_tape y, int first, int last, phi_cotangent *bar,
    double coef_bar[PHI_COEFFICIENTS])
{
    for (int k = last; k >= first; --k) {
        const int row = phi_flow_row[k] * PHI_ROW;
        phi_follow_back(phi_flow_part[k], coef + row, y[k], bar->x, coef_bar + row);
    }
}

/* Pull a cotangent back through a step; y are the states before its flows. */
static phi_status phi_stage_adjoint(const double *coef, phi_step_tape y, phi_cotangent *bar,
    double coef_bar[PHI_COEFFICIENTS])
{
    phi_flows_back(coef, y, PHI_FIRST_FLOW, PHI_LAST_FLOW, bar, coef_bar);
    return PHI_OK;
}
#endif
