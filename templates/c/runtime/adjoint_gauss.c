#ifndef PHI_FILE_ADJOINT_GAUSS
#define PHI_FILE_ADJOINT_GAUSS
#include <float.h>
#include <math.h>
#include <string.h>

#include "adjoint_stage.c"
#include "gauss.c"
#include "model.h"

#include "gauss_adjoint_policy.h"

/* Compute the cotangents of the unknowns z at all stages from the cotangents of the stage increments. */
static void phi_unknowns_bar(const phi_solver *s, double point[PHI_POINT], phi_lanes *weights, phi_lanes *z,
    phi_lanes *increments_bar, phi_lanes *z_bar)
{
#if PHI_STAGED
    phi_stage_field_adjoint_lanes(s->coef, point, z, weights, increments_bar, z_bar);
#else
    double at[PHI_UNKNOWNS], increment_bar[PHI_UNKNOWNS], unknowns_bar[PHI_UNKNOWNS];
    for (int i = 0; i < PHI_NODES; ++i) {
        for (int k = 0; k < PHI_UNKNOWNS; ++k) at[k] = z[k][i];
        for (int k = 0; k < PHI_UNKNOWNS; ++k) increment_bar[k] = increments_bar[k][i];
        phi_stage_field_adjoint(s->coef, point, at, &weights[0][i], increment_bar, unknowns_bar);
        for (int k = 0; k < PHI_UNKNOWNS; ++k) z_bar[k][i] = unknowns_bar[k];
    }
#endif
}

/* Given the cotangents of the stage increments, add their contributions to the cotangents of the start of the step and
   of the coefficients. */
static void phi_add_stages(const phi_solver *s, double point[PHI_POINT], phi_lanes *weights, phi_lanes *z,
    phi_lanes *increments_bar, phi_cotangent *bar)
{
#if PHI_STAGED
    phi_lanes x[PHI_DIM], coef[PHI_COEFFICIENTS];
    memset(coef, 0, sizeof coef); /* in case the vector field depends on no coefficient */
    phi_stage_start_adjoint_lanes(s->coef, point, z, weights, increments_bar, x, coef);
    for (int i = 0; i < PHI_NODES; ++i) {
        for (int k = 0; k < PHI_DIM; ++k) bar->x[k] += x[k][i];
        for (int k = 0; k < PHI_COEFFICIENTS; ++k) bar->coef[k] += coef[k][i];
    }
#else
    double at[PHI_UNKNOWNS], increment_bar[PHI_UNKNOWNS], x[PHI_DIM], coef[PHI_COEFFICIENTS] = { 0.0 };
    for (int i = 0; i < PHI_NODES; ++i) {
        for (int k = 0; k < PHI_UNKNOWNS; ++k) at[k] = z[k][i];
        for (int k = 0; k < PHI_UNKNOWNS; ++k) increment_bar[k] = increments_bar[k][i];
        phi_stage_start_adjoint(s->coef, point, at, &weights[0][i], increment_bar, x, coef);
        for (int k = 0; k < PHI_DIM; ++k) bar->x[k] += x[k];
        for (int k = 0; k < PHI_COEFFICIENTS; ++k) bar->coef[k] += coef[k];
    }
#endif
}

/* Compute the cotangents of the stage increments. The increments enter the step by their sum, whose cotangent is end_bar,
   and by the unknowns of the stages, whose cotangents are z_bar; mu_ij = 1 - mu_ji gives the transpose of the matrix mu. */
static void phi_mixed_back(const double end_bar[PHI_UNKNOWNS], phi_lanes *z_bar, phi_lanes *increments_bar)
{
    phi_mixed(phi_mixing, z_bar, increments_bar);
    for (int k = 0; k < PHI_UNKNOWNS; ++k) {
        double *increment_bar = increments_bar[k], sum = end_bar[k];
        for (int i = 0; i < PHI_NODES; ++i) sum += z_bar[k][i];
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_WIDTH; ++lane) increment_bar[lane] = sum - increment_bar[lane];
    }
}

/* Largest change of the cotangents at any stage: the sum of |after - before| over the unknowns, since squares could
   underflow. */
static double phi_change_back(phi_lanes *before, phi_lanes *after)
{
    double largest = 0.0;
    phi_lanes sum = { 0.0 };
    for (int k = 0; k < PHI_UNKNOWNS; ++k) {
        const double *old = before[k], *now = after[k];
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_WIDTH; ++lane) sum[lane] += fabs(now[lane] - old[lane]);
    }
    for (int i = 0; i < PHI_NODES; ++i)
        if (!(sum[i] <= largest)) largest = sum[i]; /* also true for NaN */
    return largest;
}

#if PHI_FRAMED
/* Transform cotangents of unknowns from the frame at the end of the step to the frame at its start: multiply them by the
   transpose of a matrix. Its columns are the unit vectors, transformed to the frame at the end. */
static void phi_see_back(const phi_solver *s, double point[PHI_POINT], const double end[PHI_UNKNOWNS], phi_lanes *bar)
{
    phi_lanes next_frame_bar[PHI_UNKNOWNS], unit[PHI_UNKNOWNS];
    double image[PHI_UNKNOWNS][PHI_WIDTH];
    memcpy(next_frame_bar, bar, sizeof next_frame_bar);
    for (int first = 0; first < PHI_UNKNOWNS; first += PHI_NODES) {
        memset(unit, 0, sizeof unit);
        for (int i = 0; i < PHI_NODES && first + i < PHI_UNKNOWNS; ++i) unit[first + i][i] = 1.0;
        phi_to_next_frame(s, point, end, unit, image);
        for (int i = 0; i < PHI_NODES && first + i < PHI_UNKNOWNS; ++i) {
            memset(bar[first + i], 0, sizeof bar[0]);
            for (int l = 0; l < PHI_UNKNOWNS; ++l)
                for (int lane = 0; lane < PHI_WIDTH; ++lane) bar[first + i][lane] += image[l][i] * next_frame_bar[l][lane];
        }
    }
}

#endif
/* Compute starting values for the cotangents of the stage increments, from the cotangents of the unknowns in the next
   step. The predictor of steps serves with the stages in reverse order. */
static void phi_predict_back(const phi_solver *s, double point[PHI_POINT], const double end[PHI_UNKNOWNS],
    const double end_bar[PHI_UNKNOWNS], const phi_cotangent *bar, phi_lanes *increments_bar)
{
    phi_lanes after[PHI_UNKNOWNS], reversed[PHI_UNKNOWNS];
    memcpy(after, bar->after, sizeof after);
#if PHI_FRAMED
    phi_see_back(s, point, end, after);
#else
    (void)s;
    (void)point;
    (void)end;
#endif
    memset(reversed, 0, sizeof reversed);
    for (int k = 0; k < PHI_UNKNOWNS; ++k)
        for (int i = 0; i < PHI_NODES; ++i) reversed[k][i] = after[k][PHI_NODES - 1 - i];
    phi_mixed(PHI_PREDICTOR_BY_ONE, reversed, after);
    for (int k = 0; k < PHI_UNKNOWNS; ++k) {
        for (int lane = 0; lane < PHI_WIDTH; ++lane) increments_bar[k][lane] = end_bar[k];
        for (int i = 0; i < PHI_NODES; ++i) increments_bar[k][i] += after[k][PHI_NODES - 1 - i];
    }
}

/* Solve for the cotangents of the stage increments by fixed-point sweeps, from the cotangent of their sum. */
static phi_status phi_collocate_back(const phi_solver *s, double point[PHI_POINT], phi_lanes *weights, phi_lanes *z,
    const double end[PHI_UNKNOWNS], const double end_bar[PHI_UNKNOWNS], phi_lanes *increments_bar, phi_cotangent *bar)
{
    phi_lanes z_bar[PHI_UNKNOWNS], next[PHI_UNKNOWNS];
    double last = HUGE_VAL, size = 0.0;
    int stalls = 0;
    const int first = bar->chained; /* the first sweep whose change shows the rate of convergence: 1 after a prediction */
    for (int k = 0; k < PHI_UNKNOWNS; ++k) size += fabs(end_bar[k]);
    memset(z_bar, 0, sizeof z_bar);
    memset(next, 0, sizeof next);
    if (bar->chained) phi_predict_back(s, point, end, end_bar, bar, increments_bar);
    else phi_mixed_back(end_bar, z_bar, increments_bar);
    for (int sweep = 0; sweep < PHI_MAX_SWEEPS; ++sweep) {
        phi_unknowns_bar(s, point, weights, z, increments_bar, next);
        const double change = phi_change_back(z_bar, next), rate = change / fmax(last, DBL_MIN);
        if (!isfinite(change)) return PHI_NOT_FINITE;
        memcpy(z_bar, next, sizeof next);
        phi_mixed_back(end_bar, z_bar, increments_bar);
        if (rate > PHI_ADJOINT_STALLED && change <= PHI_ADJOINT_ROUNDING * size) ++stalls;
        if (stalls > 1 || (sweep > first && change * rate <= PHI_ADJOINT_SOLVED * size)) {
            memcpy(bar->after, z_bar, sizeof z_bar);
            bar->chained = 1;
            return PHI_OK;
        }
        last = sweep < first ? HUGE_VAL : change;
    }
    return PHI_NO_CONVERGENCE;
}

/* Pull a cotangent back through the step that s has just made from the start on the tape. */
static phi_status phi_stage_adjoint(const phi_solver *s, const double *tape, phi_cotangent *bar)
{
    double point[PHI_POINT], end[PHI_UNKNOWNS], end_bar[PHI_UNKNOWNS], x[PHI_DIM], coef[PHI_COEFFICIENTS] = { 0.0 };
    phi_lanes weights[1] = { { 0.0 } }, increments[PHI_UNKNOWNS], z[PHI_UNKNOWNS];
    memcpy(point, tape, sizeof x);
#if PHI_TIMED
    point[PHI_DIM] = s->t;
#endif
    memcpy(increments, tape + PHI_DIM, sizeof increments);
    for (int i = 0; i < PHI_NODES; ++i) weights[0][i] = s->h * phi_weights[i];
    phi_end(increments, end);
    phi_mixed(phi_mixing, increments, z);
    phi_stage_change_adjoint(s->coef, point, end, bar->x, x, end_bar, coef);
    for (int k = 0; k < PHI_DIM; ++k) bar->x[k] += x[k];
    for (int k = 0; k < PHI_COEFFICIENTS; ++k) bar->coef[k] += coef[k];
    const phi_status status = phi_collocate_back(s, point, weights, z, end, end_bar, increments, bar);
    if (status == PHI_OK) phi_add_stages(s, point, weights, z, increments, bar);
    return status;
}
#endif
