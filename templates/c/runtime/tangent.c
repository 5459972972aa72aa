#ifndef PHI_FILE_TANGENT
#define PHI_FILE_TANGENT
#include <math.h>
#include <string.h>

#include "algebra.c"
#include "model.h"
#include "solver.c"

/* ---- The tangent map of a step ---- */
#include "tangent_product.c"

#include "tangent_explicit.c"
#include "tangent_gauss.c"
#include "tangent_newton.c"
#include "tangent_path.c"
#include "tangent_splitting.c"

/* Advance *at through one stage of the step that s has just made, and multiply product by the derivative of the stage. */
static phi_status phi_tangent_of(const phi_solver *s PHI_AND_INT_STAGE, phi_solver *at, double product[PHI_DIM * PHI_DIM])
{
    double derivative[PHI_DIM * PHI_DIM], both[PHI_DIM * PHI_DIM], change[PHI_DIM];
#if PHI_GAUSS
    const phi_status status = phi_tangent_stage(s, at, change, derivative);
#else
    const double *value = PHI_LAST_VALUE;
    const phi_status status = phi_tangent_stage(PHI_OF(s->coef, stage), at->x, at->carry, value, change, derivative);
#endif
    if (status != PHI_OK) return status;
    if (!phi_advance(at, change, at->carry)) return PHI_NOT_FINITE;
    phi_tangent_product(derivative, product, both);
    memcpy(product, both, sizeof both);
    return PHI_OK;
}

phi_status phi_step_tangent(phi_solver *s, double h, double tangent[PHI_DIM * PHI_DIM])
{
    double product[PHI_DIM * PHI_DIM];
    if (s == NULL || tangent == NULL) return PHI_BAD_ARGUMENT;
    const phi_solver before = *s;
    phi_solver at = before;
    phi_status status = phi_step(s, h);
    memset(product, 0, sizeof product);
    for (int i = 0; i < PHI_DIM; ++i) product[i * PHI_DIM + i] = 1.0;
    PHI_EACH_STAGE
        if (status == PHI_OK) status = phi_tangent_of(s PHI_AND_STAGE, &at, product);
    for (int i = 0; i < PHI_DIM * PHI_DIM && status == PHI_OK; ++i)
        if (!isfinite(product[i])) status = PHI_NOT_FINITE;
    if (status == PHI_OK)
        memcpy(tangent, product, sizeof product);
    else
        *s = before;
    return status;
}
#endif
