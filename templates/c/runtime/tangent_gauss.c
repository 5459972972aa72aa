#ifndef PHI_FILE_TANGENT_GAUSS
#define PHI_FILE_TANGENT_GAUSS
#include <float.h>
#include <math.h>
#include <string.h>

#include "algebra.c"
#include "model.h"
#include "solver.c"

enum { PHI_SLOPES = PHI_UNKNOWNS * (PHI_DIM + PHI_UNKNOWNS) }; /* number of derivatives of the vector field at a stage, by x and by the unknowns */
#include "gauss_tangent_policy.h"

/* Compute the derivatives of the stage increments by coordinate j at the start of the step. The derivatives solve
   linear equations, by fixed-point sweeps. Returns 0 if the sweeps do not converge. */
static int phi_vary(const phi_solver *s, double slopes[PHI_NODES][PHI_SLOPES], int j, phi_lanes *varied)
{
    phi_lanes z[PHI_UNKNOWNS];
    double previous = HUGE_VAL;
    memset(z, 0, sizeof z);
    for (int sweep = 0; sweep <= PHI_MAX_SWEEPS; ++sweep) {
        double change = 0.0, size = DBL_MIN;
        for (int k = 0; k < PHI_UNKNOWNS; ++k)
            for (int i = 0; i < PHI_NODES; ++i) {
                const double *row = slopes[i] + k * (PHI_DIM + PHI_UNKNOWNS);
                double sum = row[j];
                for (int l = 0; l < PHI_UNKNOWNS; ++l) sum += row[PHI_DIM + l] * z[l][i];
                sum *= s->h * phi_weights[i];
                if (sweep > 0) change = fmax(change, fabs(sum - varied[k][i]));
                size = fmax(size, fabs(sum));
                if (!isfinite(sum)) return 0;
                varied[k][i] = sum;
            }
        for (int k = 0; k < PHI_UNKNOWNS; ++k)
            for (int i = PHI_NODES; i < PHI_WIDTH; ++i) varied[k][i] = 0.0;
        phi_mixed(phi_mixing, varied, z);
        if (sweep == 0) continue;
        if (change <= PHI_TANGENT_SOLVED * size) return 1;
        if (change <= PHI_TANGENT_NEARLY_SOLVED * size && change > PHI_TANGENT_SHRINKING * previous) return 1;
        previous = change;
    }
    return 0;
}

/* Compute the change of x in the step that s has made from *at, and the derivative of this step. */
static phi_status phi_tangent_stage(const phi_solver *s, const phi_solver *at, double change[PHI_DIM],
    double derivative[PHI_DIM * PHI_DIM])
{
    double point[PHI_POINT], end[PHI_UNKNOWNS], node[PHI_UNKNOWNS], along[PHI_UNKNOWNS];
    double slopes[PHI_NODES][PHI_SLOPES], outer[PHI_DIM * (PHI_DIM + PHI_UNKNOWNS)];
    phi_lanes increments[PHI_UNKNOWNS], z[PHI_UNKNOWNS];
    phi_solver twin = *s;
    memcpy(twin.x, at->x, sizeof twin.x);
    twin.t = at->t;
    twin.history.count = 0;
    phi_start(&twin, point);
    const phi_status status = phi_collocate(&twin, point, increments);
    if (status != PHI_OK) return status;
    phi_mixed(phi_mixing, increments, z);
    for (int i = 0; i < PHI_NODES; ++i) {
        for (int k = 0; k < PHI_UNKNOWNS; ++k) node[k] = z[k][i];
        phi_stage_slope_jacobian(s->coef, point, node, slopes[i]);
    }
    phi_end(increments, end);
    phi_stage_change(s->coef, point, end, change);
    phi_stage_change_jacobian(s->coef, point, end, outer);
    for (int j = 0; j < PHI_DIM; ++j) {
        if (!phi_vary(s, slopes, j, increments)) return PHI_NO_CONVERGENCE;
        phi_end(increments, along);
        for (int i = 0; i < PHI_DIM; ++i) {
            const double *row = outer + i * (PHI_DIM + PHI_UNKNOWNS);
            double sum = row[j] + (i == j ? 1.0 : 0.0);
            for (int k = 0; k < PHI_UNKNOWNS; ++k) sum += row[PHI_DIM + k] * along[k];
            derivative[i * PHI_DIM + j] = sum;
        }
    }
    return PHI_OK;
}
#endif
