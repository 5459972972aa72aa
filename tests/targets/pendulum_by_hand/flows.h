/* Strang's splitting: half a drift, a kick, half a drift. Rows of coefficients: for a drift, for a kick. */
#ifndef FLOWS_H
#define FLOWS_H
#include "model.h"

static const double phi_times[PHI_ROWS_OF_FLOWS] = { 0.5, 1.0 };

static void phi_prepare_row(const phi_params *params, double h, double coef[PHI_ROW])
{
    coef[0] = h;
    coef[1] = h * params->g;
}

static inline void phi_flow1(const double *coef, double x[2], double moved[2], const double start[2])
{
    phi_add(x, moved, start, 0, coef[0] * x[1]);
}

static inline void phi_flow2(const double *coef, double x[2], double moved[2], const double start[2])
{
    phi_add(x, moved, start, 1, -coef[1] * sin(x[0]));
}

#if PHI_ADJOINT
static void phi_flows(const double *coef, double x[2], double moved[2], const double start[2], double (*kept)[2])
{
    for (int k = 0; k < PHI_FLOWS; ++k) {
        if (kept != NULL) memcpy(kept++, x, sizeof *kept);
        if (k != 1) phi_flow1(coef, x, moved, start);
        else phi_flow2(coef + PHI_ROW, x, moved, start);
    }
}
#else
static void phi_flows(const double *coef, double x[2], double moved[2], const double start[2])
{
    phi_flow1(coef, x, moved, start);
    phi_flow2(coef + PHI_ROW, x, moved, start);
    phi_flow1(coef, x, moved, start);
}
#endif
#endif
