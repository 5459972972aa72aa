/* The implicit midpoint rule as a Gauss method of one stage, which is predicted by the last step. */
#ifndef GAUSS_TABLES_H
#define GAUSS_TABLES_H
#include <string.h>

static const double phi_nodes[PHI_NODES] = { 0.5 };
static const double phi_weights[PHI_WIDTH] = { 1.0 };
static const double phi_mixing[PHI_NODES][PHI_WIDTH] = { { 0.5 } };
static const double phi_prediction[PHI_NODES][PHI_WIDTH] = { { 0.5 } };

static double phi_total(const double values[PHI_WIDTH])
{
    return values[0];
}

static void phi_mixed(const double matrix[PHI_NODES][PHI_WIDTH], double moves[][PHI_WIDTH], phi_lanes *z)
{
    for (int k = 0; k < PHI_UNKNOWNS; ++k) z[k][0] = matrix[0][0] * moves[k][0];
}
#endif
