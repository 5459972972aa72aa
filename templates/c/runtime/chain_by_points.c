#ifndef PHI_FILE_CHAIN_BY_POINTS
#define PHI_FILE_CHAIN_BY_POINTS
#include <string.h>
#include "model.h"
#include "newton_lanes.c"

/* Advance x + carry through the steps of a block in order. In the linear model, a step adds `increment` - `gain` * r to
   x, where r is the residual of the equation for y. The residual of the next step follows from the residual of
   the present step, without the new x. `most` receives the largest correction of y in each lane. */
static void phi_chain(phi_model *model, phi_lanes unit[restrict PHI_DIM], double x[PHI_DIM], double carry[PHI_DIM],
    phi_lanes most)
{
    double residual[PHI_DIM], sum[PHI_DIM], rest[PHI_DIM];
#if PHI_SPARSE
    double delta[PHI_DIM], gained[PHI_DIM];
#endif
    for (int i = 0; i < PHI_DIM; ++i) {
        residual[i] = ((model->y[i][0] - x[i]) + model->displacement[i][0]) - carry[i];
        sum[i] = x[i];
        rest[i] = carry[i];
    }
#if PHI_COMPOSED
    for (int k = 0; k < (int)PHI_STAGES * PHI_LANES; ++k) {
        const int lane = k / PHI_STAGES, after = (k + 1) / PHI_STAGES % PHI_LANES;
        const int stage = k % PHI_STAGES, next = (k + 1) % PHI_STAGES;
#else
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        const int after = (lane + 1) % PHI_LANES;
#endif
#if PHI_SPARSE
        phi_substitute_lane(PHI_IN(model, stage, factor), PHI_IN(model, stage, slope), residual, lane, delta, gained);
        for (int i = 0; i < PHI_DIM; ++i) {
            const double change = PHI_IN(model, stage, increment)[i][lane], total = sum[i] + change, added = total - sum[i];
            const double turn = (PHI_IN(model, next, displacement)[i][after] - PHI_IN(model, stage, displacement)[i][lane]) - change;
            PHI_IN(model, stage, residual)[i][lane] = residual[i];
            residual[i] = (((PHI_IN(model, next, y)[i][after] - PHI_IN(model, stage, y)[i][lane]) + turn) + residual[i]) + gained[i];
            rest[i] += ((sum[i] - (total - added)) + (change - added)) - gained[i];
            sum[i] = total;
        }
#else
        double even[PHI_DIM] = { 0.0 }, odd[PHI_DIM] = { 0.0 }; /* two partial sums of gain * residual, since additions in one sum wait for each other */
        for (int i = 0; i < PHI_DIM; ++i) {
            PHI_IN(model, stage, residual)[i][lane] = residual[i];
            for (int j = 0; j < PHI_DIM; j += 2) even[i] += PHI_IN(model, stage, gain)[i * PHI_DIM + j][lane] * residual[j];
            for (int j = 1; j < PHI_DIM; j += 2) odd[i] += PHI_IN(model, stage, gain)[i * PHI_DIM + j][lane] * residual[j];
        }
        for (int i = 0; i < PHI_DIM; ++i) {
            const double change = PHI_IN(model, stage, increment)[i][lane], total = sum[i] + change, added = total - sum[i];
            const double turn = (PHI_IN(model, next, displacement)[i][after] - PHI_IN(model, stage, displacement)[i][lane]) - change;
            const double y_change = (PHI_IN(model, next, y)[i][after] - PHI_IN(model, stage, y)[i][lane]) + turn;
            residual[i] = ((y_change + residual[i]) + odd[i]) + even[i];
            rest[i] += ((sum[i] - (total - added)) + (change - added)) - (even[i] + odd[i]);
            sum[i] = total;
        }
#endif
    }
    for (int i = 0; i < PHI_DIM; ++i) {
        x[i] = sum[i] + rest[i];
        carry[i] = rest[i] - (x[i] - sum[i]);
    }
#if PHI_COMPOSED
    phi_lanes size;
    memset(most, 0, PHI_LANES * sizeof most[0]);
    for (int stage = 0; stage < PHI_STAGES; ++stage) {
        phi_correct(model + stage, unit, size);
        phi_update_largest(most, size);
    }
#else
    phi_correct(model, unit, most);
#endif
}
#endif
