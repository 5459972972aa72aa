#ifndef PHI_FILE_TANGENT_SPLITTING
#define PHI_FILE_TANGENT_SPLITTING
#include <math.h>
#include <string.h>

#include "algebra.c"
#include "model.h"
#include "solver.c"
#include "tangent_flows.h"
#include "tangent_product.c"

/* Compute the derivative of one step, the product of the derivatives of its flows, and the change of x + carry in the
   step. The argument `value` is unused. */
static phi_status phi_tangent_stage(const double *coef, const double x[PHI_DIM], const double carry[PHI_DIM],
    const double value[PHI_DIM], double change[PHI_DIM], double derivative[PHI_DIM * PHI_DIM])
{
#if PHI_MONITOR
    double y[PHI_ALONG] = { 0.0 }, displacement[PHI_ALONG] = { 0.0 }, start[PHI_ALONG] = { 0.0 };
    double slope[PHI_DIM * PHI_DIM], product[PHI_DIM * PHI_DIM];
    (void)value;
    memcpy(start, x, PHI_DIM * sizeof x[0]);
    memcpy(y, x, PHI_DIM * sizeof x[0]);
    memcpy(displacement, carry, PHI_DIM * sizeof carry[0]);
#else
    double y[PHI_DIM], displacement[PHI_DIM], slope[PHI_DIM * PHI_DIM], product[PHI_DIM * PHI_DIM];
    (void)value;
    memcpy(y, x, sizeof y);
    memcpy(displacement, carry, sizeof displacement);
#endif
    memset(derivative, 0, sizeof product);
    for (int i = 0; i < PHI_DIM; ++i) derivative[i * PHI_DIM + i] = 1.0;
    for (int k = 0; k < PHI_FLOWS; ++k) {
#if PHI_MONITOR
        phi_tangent_flow(phi_part_of[k], coef + phi_row_of[k] * PHI_ROW, y, displacement, start, slope);
#else
        phi_tangent_flow(phi_part_of[k], coef + phi_row_of[k] * PHI_ROW, y, displacement, x, slope);
#endif
        phi_tangent_product(slope, derivative, product);
        for (int i = 0; i < PHI_DIM * PHI_DIM; ++i) derivative[i] += product[i];
    }
    for (int i = 0; i < PHI_DIM; ++i) change[i] = displacement[i] - carry[i];
    return PHI_OK;
}
#endif
