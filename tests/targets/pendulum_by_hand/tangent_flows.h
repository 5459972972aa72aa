#ifndef TANGENT_FLOWS_H
#define TANGENT_FLOWS_H
#include "flows.h"

static const int phi_part_of[PHI_FLOWS] = { 1, 2, 1 };
static const int phi_row_of[PHI_FLOWS] = { 0, 1, 0 };

static void phi_tangent_flow(int part, const double *coef, double x[2], double moved[2], const double start[2],
    double slope[4])
{
    memset(slope, 0, 4 * sizeof slope[0]);
    if (part == 1) slope[1] = coef[0];
    else slope[2] = -coef[1] * cos(x[0]);
    if (part == 1) phi_flow1(coef, x, moved, start);
    else phi_flow2(coef, x, moved, start);
}
#endif
