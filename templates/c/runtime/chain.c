#ifndef PHI_FILE_CHAIN
#define PHI_FILE_CHAIN
#include <string.h>

#include "model.h"
#include "newton_lanes.c"

/* ---- The residuals of a block ---- */
#if PHI_SWEPT
/* What a step makes of a residual of its first stage, one of the next step: each stage makes 1 + gain of it. */
static void phi_turn_residuals(phi_model *model, phi_lanes turn[restrict PHI_DIM * PHI_DIM])
{
    memset(turn, 0, PHI_DIM * PHI_DIM * sizeof turn[0]);
    for (int i = 0; i < PHI_DIM; ++i)
        for (int lane = 0; lane < PHI_LANES; ++lane) turn[i * PHI_DIM + i][lane] = 1.0;
    for (int stage = 0; stage < PHI_STAGES; ++stage) {
        phi_model *this_stage = model + stage;
        for (int j = 0; j < PHI_DIM; ++j) {
            phi_lanes column[PHI_DIM], gained[PHI_DIM];
            for (int i = 0; i < PHI_DIM; ++i) memcpy(column[i], turn[i * PHI_DIM + j], sizeof column[i]);
            phi_gain(this_stage, column, gained);
            for (int i = 0; i < PHI_DIM; ++i) {
                PHI_EACH_LANE
                for (int lane = 0; lane < PHI_LANES; ++lane)
                    turn[i * PHI_DIM + j][lane] = column[i][lane] + gained[i][lane];
            }
        }
    }
}

/* By how much the residual of a stage would change to that of the next, did it not turn. After the last stage comes the first
   of the next lane; in the last lane it is of no use. */
static void phi_shift(const phi_model *model, int stage, phi_lanes shift[restrict PHI_DIM])
{
    const phi_model *this_stage = model + stage, *next_stage = model + (stage + 1) % PHI_STAGES;
    const int ahead = stage == PHI_STAGES - 1;
    for (int i = 0; i < PHI_DIM; ++i) {
        phi_lanes y, displacement;
        memcpy(y, next_stage->y[i], sizeof y);
        memcpy(displacement, next_stage->displacement[i], sizeof displacement);
        if (ahead) {
            memmove(y, y + 1, sizeof y - sizeof y[0]);
            memmove(displacement, displacement + 1, sizeof displacement - sizeof displacement[0]);
        }
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            const double turn = (displacement[lane] - this_stage->displacement[i][lane]) - this_stage->increment[i][lane];
            shift[i][lane] = (y[lane] - this_stage->y[i][lane]) + turn;
        }
    }
}

/* The residuals of the first stages of all steps: each step is affine in that of its first stage. */
static void phi_first_residuals(phi_model *model, phi_lanes turn[restrict PHI_DIM * PHI_DIM], const double x[PHI_DIM],
    const double carry[PHI_DIM], phi_lanes residual[restrict PHI_DIM])
{
    phi_lanes end[PHI_DIM], gained[PHI_DIM];
    double first[PHI_DIM];
    memset(end, 0, sizeof end);
    for (int stage = 0; stage < PHI_STAGES; ++stage) {
        phi_model *this_stage = model + stage;
        phi_shift(model, stage, this_stage->residual);
        phi_gain(this_stage, end, gained);
        for (int i = 0; i < PHI_DIM; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) end[i][lane] += gained[i][lane] + this_stage->residual[i][lane];
        }
    }
    for (int i = 0; i < PHI_DIM; ++i)
        first[i] = ((model->y[i][0] - x[i]) + model->displacement[i][0]) - carry[i];
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        double next[PHI_DIM];
        for (int i = 0; i < PHI_DIM; ++i) {
            residual[i][lane] = first[i];
            next[i] = end[i][lane];
            for (int j = 0; j < PHI_DIM; ++j) next[i] += turn[i * PHI_DIM + j][lane] * first[j];
        }
        memcpy(first, next, sizeof first);
    }
}

/* What a residual takes from y, and from the increment. */
static void phi_answer(phi_model *model, phi_lanes residual[restrict PHI_DIM], phi_lanes delta[restrict PHI_DIM],
    phi_lanes gained[restrict PHI_DIM])
{
    phi_apply(model->inverse, residual, delta);
#if PHI_CENTRED
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) gained[i][lane] = 2.0 * (delta[i][lane] - residual[i][lane]);
    }
#else
    phi_gain(model, residual, gained);
#endif
}

/* Correct the points of all stages by the residuals along their linear models, and find where the steps lead. As X, the
   state with its carry, gains increment - gain residual, the next residual follows from this one; X itself is added up
   apart. most is the largest correction in each lane. */
static void phi_chain(phi_model *model, phi_lanes turn[restrict PHI_DIM * PHI_DIM], phi_lanes unit[restrict PHI_DIM],
    double x[PHI_DIM], double carry[PHI_DIM], phi_lanes most)
{
    phi_lanes residual[PHI_DIM], sum[PHI_DIM], small[PHI_DIM], size;
    memset(most, 0, PHI_LANES * sizeof most[0]);
    phi_first_residuals(model, turn, x, carry, residual);
    memset(sum, 0, sizeof sum);
    memset(small, 0, sizeof small);
    for (int stage = 0; stage < PHI_STAGES; ++stage) {
        phi_model *this_stage = model + stage;
        phi_lanes delta[PHI_DIM], gained[PHI_DIM];
        phi_answer(this_stage, residual, delta, gained);
        for (int i = 0; i < PHI_DIM; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) {
                const double change = this_stage->increment[i][lane], total = sum[i][lane] + change;
                const double added = total - sum[i][lane];
                small[i][lane] += ((sum[i][lane] - (total - added)) + (change - added)) - gained[i][lane];
                sum[i][lane] = total;
                residual[i][lane] = (residual[i][lane] + gained[i][lane]) + this_stage->residual[i][lane];
            }
        }
        phi_take(this_stage, delta, unit, size);
        phi_keep_largest(most, size);
    }
    for (int i = 0; i < PHI_DIM; ++i) {
        double whole = x[i], rest = carry[i];
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            const double total = whole + sum[i][lane], added = total - whole;
            rest += ((whole - (total - added)) + (sum[i][lane] - added)) + small[i][lane];
            whole = total;
        }
        x[i] = whole + rest;
        carry[i] = rest - (x[i] - whole);
    }
}

#else
/* The steps of a block one after the other, each along the linear model of its lane. As X, the state with its carry, gains
   increment - gain residual, the next residual follows from this one; X itself is added up apart. most is the largest
   correction in each lane. */
static void phi_chain(phi_model *model, phi_lanes unit[restrict PHI_DIM], double x[PHI_DIM], double carry[PHI_DIM],
    phi_lanes most)
{
    double residual[PHI_DIM], sum[PHI_DIM], small[PHI_DIM];
#if PHI_SPARSE
    double delta[PHI_DIM], gained[PHI_DIM];
#endif
    for (int i = 0; i < PHI_DIM; ++i) {
        residual[i] = ((model->y[i][0] - x[i]) + model->displacement[i][0]) - carry[i];
        sum[i] = x[i];
        small[i] = carry[i];
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
            small[i] += ((sum[i] - (total - added)) + (change - added)) - gained[i];
            sum[i] = total;
        }
#else
        double even[PHI_DIM] = { 0.0 }, odd[PHI_DIM] = { 0.0 }; /* two sums, so that no long chain of additions is waited for */
        for (int i = 0; i < PHI_DIM; ++i) {
            PHI_IN(model, stage, residual)[i][lane] = residual[i];
            for (int j = 0; j < PHI_DIM; j += 2) even[i] += PHI_IN(model, stage, gain)[i * PHI_DIM + j][lane] * residual[j];
            for (int j = 1; j < PHI_DIM; j += 2) odd[i] += PHI_IN(model, stage, gain)[i * PHI_DIM + j][lane] * residual[j];
        }
        for (int i = 0; i < PHI_DIM; ++i) {
            const double change = PHI_IN(model, stage, increment)[i][lane], total = sum[i] + change, added = total - sum[i];
            const double turn = (PHI_IN(model, next, displacement)[i][after] - PHI_IN(model, stage, displacement)[i][lane]) - change;
            const double moved = (PHI_IN(model, next, y)[i][after] - PHI_IN(model, stage, y)[i][lane]) + turn;
            residual[i] = ((moved + residual[i]) + odd[i]) + even[i];
            small[i] += ((sum[i] - (total - added)) + (change - added)) - (even[i] + odd[i]);
            sum[i] = total;
        }
#endif
    }
    for (int i = 0; i < PHI_DIM; ++i) {
        x[i] = sum[i] + small[i];
        carry[i] = small[i] - (x[i] - sum[i]);
    }
#if PHI_COMPOSED
    phi_lanes size;
    memset(most, 0, PHI_LANES * sizeof most[0]);
    for (int stage = 0; stage < PHI_STAGES; ++stage) {
        phi_correct(model + stage, unit, size);
        phi_keep_largest(most, size);
    }
#else
    phi_correct(model, unit, most);
#endif
}

#endif
#endif
