#ifndef ADJOINT_FLOWS_H
#define ADJOINT_FLOWS_H
#include "flows.h"

static const int phi_flow_part[PHI_FLOWS] = { 1, 2, 1 };
static const int phi_flow_row[PHI_FLOWS] = { 0, 1, 0 };

static void phi_follow_back(int part, const double *coef, const double x[2], double bar[2], double coef_bar[PHI_ROW])
{
    if (part == 1) {
        coef_bar[0] += x[1] * bar[0];
        bar[1] += coef[0] * bar[0];
    } else {
        coef_bar[1] -= sin(x[0]) * bar[1];
        bar[0] -= coef[1] * cos(x[0]) * bar[1];
    }
}
#endif
