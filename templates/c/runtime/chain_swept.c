#ifndef PHI_FILE_CHAIN_SWEPT
#define PHI_FILE_CHAIN_SWEPT
#include <string.h>
#include "model.h"
#include "newton_lanes.c"

/* Compute, for the step in each lane, the product of 1 + gain over its stages. This matrix says how the residual of the
   first stage contributes to the residual of the first stage of the next step. */
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

/* The residual of the next stage is (1 + gain) residual + shift. Compute shift for a stage in all lanes. The last stage of
   a lane is followed by the first stage of the next lane; the last lane then gets a value that is unused. */
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

/* Compute the residuals of the first stages of all steps, one after the other, by the affine maps from step to step. */
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

/* From the residual of a stage, compute the Newton corrections of its y (delta) and of its increment (gained). */
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

/* Correct the points y of all stages by their residuals, and advance x + carry through all steps. In the linear
   model, a stage adds `increment` - `gain` * r to x, where r is its residual. The residual of the next stage follows from the residual of the
   present stage, without the new x. `most` receives the largest correction of y in each lane. */
static void phi_chain(phi_model *model, phi_lanes turn[restrict PHI_DIM * PHI_DIM], phi_lanes unit[restrict PHI_DIM],
    double x[PHI_DIM], double carry[PHI_DIM], phi_lanes most)
{
    phi_lanes residual[PHI_DIM], sum[PHI_DIM], low[PHI_DIM], size;
    memset(most, 0, PHI_LANES * sizeof most[0]);
    phi_first_residuals(model, turn, x, carry, residual);
    memset(sum, 0, sizeof sum);
    memset(low, 0, sizeof low);
    for (int stage = 0; stage < PHI_STAGES; ++stage) {
        phi_model *this_stage = model + stage;
        phi_lanes delta[PHI_DIM], gained[PHI_DIM];
        phi_answer(this_stage, residual, delta, gained);
        for (int i = 0; i < PHI_DIM; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) {
                const double change = this_stage->increment[i][lane], total = sum[i][lane] + change;
                const double added = total - sum[i][lane];
                low[i][lane] += ((sum[i][lane] - (total - added)) + (change - added)) - gained[i][lane];
                sum[i][lane] = total;
                residual[i][lane] = (residual[i][lane] + gained[i][lane]) + this_stage->residual[i][lane];
            }
        }
        phi_take(this_stage, delta, unit, size);
        phi_update_largest(most, size);
    }
    for (int i = 0; i < PHI_DIM; ++i) {
        double rounded = x[i], rest = carry[i];
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            const double total = rounded + sum[i][lane], added = total - rounded;
            rest += ((rounded - (total - added)) + (sum[i][lane] - added)) + low[i][lane];
            rounded = total;
        }
        x[i] = rounded + rest;
        carry[i] = rest - (x[i] - rounded);
    }
}
#endif
