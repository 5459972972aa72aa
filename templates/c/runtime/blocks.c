#ifndef PHI_FILE_BLOCKS
#define PHI_FILE_BLOCKS
#include <limits.h>
#include <math.h>
#include <string.h>

#include "chain.c"
#include "model.h"
#include "newton_lanes.c"
#include "solver.c"

/* ---- Blocks of steps ---- */
#include "blocks_slopes.h"

/* Data for all blocks of steps: the coefficients in each lane, and the recurrences that predict the solutions. */
typedef struct {
#include "state_of_table.h"
} phi_table;

/* Whether the predicted points of all stages and lanes are near the state `last`. */
static int phi_near_lanes(phi_model *model, const double last[PHI_DIM])
{
    phi_lanes most = { 0.0 };
    double size = 0.0;
    for (int i = 0; i < PHI_DIM; ++i) size += fabs(last[i]);
    PHI_EACH_STAGE {
        phi_lanes distance = { 0.0 };
        for (int i = 0; i < PHI_DIM; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) distance[lane] += fabs(PHI_IN(model, stage, y)[i][lane] - last[i]);
        }
        phi_update_largest(most, distance);
    }
    return phi_largest(most) <= PHI_REACH * size;
}

/* If the recurrences of a stage have been fitted anew, copy their weights and the coefficients of the stage to the
   table. */
static void phi_refresh(const phi_solver *s PHI_AND_INT_STAGE, phi_table *table)
{
    if (PHI_OF(table->fits, stage) == PHI_OF(s->history, stage).fits) return;
    PHI_OF(table->fits, stage) = PHI_OF(s->history, stage).fits;
    for (int k = 0; k < PHI_COEFFICIENTS; ++k)
        for (int lane = 0; lane < PHI_LANES; ++lane) PHI_OF(table->coef, stage)[k][lane] = PHI_OF(s->coef, stage)[k];
    memcpy(PHI_OF(table->weight, stage), PHI_OF(s->history, stage).weight,
        (size_t)PHI_OF(s->history, stage).recurrence_terms * PHI_DIM * sizeof(phi_lanes));
}

#include "blocks_renewed.c"

/* Predict the next PHI_LANES solutions of a stage by its recurrences. */
static void phi_foresee(const phi_history *history, phi_lanes weight[restrict][PHI_DIM],
    phi_lanes y[restrict PHI_DIM])
{
    const int last = history->count - 1;
    for (int i = 0; i < PHI_DIM; ++i) {
        phi_lanes even = { 0.0 }, odd = { 0.0 };
        for (int k = 0; k < history->recurrence_terms; k += 2) {
            const double past = history->past[last - k][i], earlier = history->past[last - 1 - k][i];
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) even[lane] += weight[k][i][lane] * past;
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) odd[lane] += weight[k + 1][i][lane] * earlier;
        }
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) y[i][lane] = even[lane] + odd[lane];
    }
}

/* Append the solutions in all lanes to the history; lane 0 is the earliest step. */
static void phi_record_lanes(phi_history *history, phi_lanes y[restrict PHI_DIM])
{
    phi_make_room(history, PHI_LANES);
    for (int lane = 0; lane < PHI_LANES; ++lane)
        for (int i = 0; i < PHI_DIM; ++i) history->past[history->count + lane][i] = y[i][lane];
    history->count += PHI_LANES;
}

#if PHI_MONITOR
/* Vector field at x, per unit of tau. */
#else
/* Vector field at x. */
#endif
static void phi_slope(const phi_solver *s PHI_AND_DOUBLE_T, const double x[PHI_DIM], double slope[PHI_DIM])
{
    phi_vector_field(&s->params PHI_AND_T(t), x, slope);
    phi_make_per_tau(&s->params, x, slope);
}

/* Make a step of size h by the classical Runge-Kutta method. x becomes the end of the step; `mean` receives the
   increment divided by h. */
static void phi_runge_kutta(const phi_solver *s PHI_AND_DOUBLE_T, double h, double x[PHI_DIM], double mean[PHI_DIM])
{
    static const double reach[4] = { 0.5, 0.5, 1.0, 0.0 }, weight[4] = { 1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0 };
    PHI_TIMES_OF_SLOPES
    double point[PHI_DIM], slope[PHI_DIM];
    memcpy(point, x, sizeof point);
    memset(mean, 0, PHI_DIM * sizeof mean[0]);
    for (int part = 0; part < 4; ++part) {
        phi_slope(s PHI_AND_T(t + after[part] * h), point, slope);
        for (int i = 0; i < PHI_DIM; ++i) {
            mean[i] += weight[part] * slope[i];
            point[i] = x[i] + h * reach[part] * slope[i];
        }
    }
    for (int i = 0; i < PHI_DIM; ++i) x[i] += h * mean[i];
}

#include "blocks_adams.c"
#include "blocks_prediction.c"

/* Predict the solutions of all stages of all steps of a block: by recurrences if they are in use, else by approximate
   integration. Returns 0 if a prediction is not near the state. */
static int phi_predict_block(phi_solver *s, phi_table *table, phi_model *model)
{
    if (!s->blocks.use_recurrences) phi_predict_by_march(s, table, model);
    if (s->blocks.use_recurrences) phi_end_march(table);
    PHI_EACH_STAGE
        if (s->blocks.use_recurrences) phi_foresee(&PHI_OF(s->history, stage), PHI_OF(table->weight, stage), PHI_IN(model, stage, y));
    return phi_near_lanes(model, s->x);
}

#include "blocks_elapsed.c"

#include "blocks_attitude.c"

/* Make PHI_LANES steps at once: predict the solutions of all, and correct them together until the remaining error is as
   small as after a single step. Returns the number of iterations, at most `most`. On failure, returns 0 and leaves the
   state unchanged. */
static int phi_block(phi_solver *s, phi_table *table, int most)
{
    phi_model PHI_OF(model, PHI_STAGES);
    phi_lanes unit[PHI_DIM], size, before, left;
    double x[PHI_DIM], carry[PHI_DIM], previous = HUGE_VAL;
    int passes = 0, solved = 0;
    PHI_TURN_OF_BLOCK
    if (!phi_predict_block(s, table, PHI_ADDRESS(model))) return 0;
    for (int lane = 0; lane < PHI_LANES; ++lane) size[lane] = HUGE_VAL;
    while (!solved) {
        const int matrices = previous > PHI_FROZEN;
        PHI_EACH_STAGE phi_update(PHI_OF(table->coef, stage), &PHI_OF(model, stage), matrices);
        memcpy(x, s->x, sizeof x);
        memcpy(carry, s->carry, sizeof carry);
        memcpy(before, size, sizeof before);
        if (matrices) phi_measure(PHI_ADDRESS(model) PHI_AND_STAGES, unit);
        if (matrices) phi_turn_residuals(model, turn);
        phi_chain(PHI_ADDRESS(model) PHI_AND_TURN, unit, x, carry, size);
        s->evaluations += PHI_ALL_STAGES(PHI_LANES);
        phi_leave(size, before, left);
        solved = phi_largest(left) <= PHI_TOLERANCE;
        const double largest = phi_largest(size);
        if ((++passes >= most || !(largest < previous)) && !solved) return 0;
        previous = largest;
    }
    if (!phi_near_lanes(PHI_ADDRESS(model), s->x)) return 0;
    for (int i = 0; i < PHI_DIM; ++i)
        if (!isfinite(x[i])) return 0;
    PHI_ELAPSED_OF_BLOCK
    PHI_ELAPSE
    memcpy(s->x, x, sizeof x);
    memcpy(s->carry, carry, sizeof carry);
    phi_pass_lanes(s, elapsed, lost);
    s->steps += PHI_LANES;
    PHI_COUNT_TIME(s)
    phi_turn_block(s, table, PHI_ADDRESS(model));
    PHI_EACH_STAGE {
        phi_history *history = &PHI_OF(s->history, stage);
        phi_record_lanes(history, PHI_OF(model, stage).y);
        history->slow_steps = passes > 1 ? history->slow_steps + PHI_LANES : 0;
        if (history->slow_steps > history->slow_steps_allowed && s->blocks.use_recurrences) phi_fit(history);
    }
    return passes;
}

enum {
    PHI_REPAY_BLOCKS = 4 * PHI_REPAY, /* number of steps that repay a fit of recurrences; after recurrences fail for the first time, this number of steps is made without them */
    PHI_MOST_SINGLE_STEPS = 1000,     /* largest number of single steps after a failed block */
    PHI_TOO_MANY = 5 * PHI_LANES      /* recurrences are abandoned if a failed block leads to more single steps than this */
};
#define PHI_LATEST 0.125 /* weight of the latest single step in the running mean of evaluations */

/* Stop using recurrences. The number of steps until they are tried again doubles with every failure. */
static void phi_give_up(phi_solver *s)
{
    s->blocks.use_recurrences = s->blocks.last_single_steps = s->blocks.single_steps = 0;
    s->blocks.steps_without_recurrences = 2 * s->blocks.steps_without_recurrences + PHI_REPAY_BLOCKS;
    s->blocks.recurrences_from_step = s->steps + s->blocks.steps_without_recurrences;
}

/* Choose the predictor of the next block. Recurrences are fitted as soon as the number of steps to come, or of steps
   already made, is large enough for them to repay the fit. */
static void phi_choose_predictor(phi_solver *s, size_t steps)
{
    PHI_EACH_STAGE
        if (PHI_OF(s->history, stage).count < PHI_REMEMBERED) {
            s->blocks.use_recurrences = 0;
            return;
        }
    if (s->blocks.use_recurrences || s->steps < s->blocks.recurrences_from_step) return;
    if (steps < PHI_REPAY_BLOCKS && s->steps < PHI_REPAY) return;
    s->blocks.use_recurrences = 1;
    PHI_EACH_STAGE s->blocks.use_recurrences = s->blocks.use_recurrences && phi_fit(&PHI_OF(s->history, stage));
    s->blocks.single_steps = PHI_LANES;
    if (!s->blocks.use_recurrences) phi_give_up(s);
}

/* Update the measurements after a block that took `passes` iterations; 0 means that it failed. After a failed block, single
   steps are made, more with every failure. Recurrences are abandoned if they fail repeatedly, or need more iterations than
   Runge-Kutta predictions did. */
static void phi_learn_from(phi_solver *s, int passes)
{
    if (passes > 0) {
        s->blocks.last_single_steps /= 2;
    } else {
        const int longer = 2 * s->blocks.last_single_steps + PHI_LANES;
        s->blocks.last_single_steps = longer > PHI_MOST_SINGLE_STEPS ? PHI_MOST_SINGLE_STEPS : longer;
        s->blocks.single_steps = s->blocks.last_single_steps;
    }
    if (!s->blocks.use_recurrences) {
        s->blocks.passes_without_recurrences = passes > 0 ? passes : INT_MAX;
    } else if (passes > s->blocks.passes_without_recurrences || s->blocks.last_single_steps > PHI_TOO_MANY) {
        phi_give_up(s);
    }
}

/* Make a single step, and update the running mean of the number of evaluations in a stage. */
static phi_status phi_single(phi_solver *s)
{
    const size_t before = s->evaluations;
    const phi_status status = phi_single_steps(s, s->h, 1);
    const double evaluations = (double)(s->evaluations - before) PHI_PER_STAGE;
    s->blocks.evaluations_per_stage += PHI_LATEST * (evaluations - s->blocks.evaluations_per_stage);
    return status;
}

/* Make steps in blocks as long as blocks cost less than single steps: a block may take at most PHI_PASSES times as many
   iterations as a single step takes evaluations. Results differ from those of single steps by round-off only. */
phi_status phi_integrate(phi_solver *s, double h, size_t steps)
{
    phi_table table;
    phi_status status = phi_single_steps(s, h, 0); /* 0 steps: computes all coefficients for h */
    PHI_EACH_STAGE PHI_OF(table.fits, stage) = -1;
    phi_end_march(&table);
    while (status == PHI_OK && steps > 0) {
        if (steps >= PHI_LANES && s->blocks.single_steps == 0) phi_choose_predictor(s, steps);
        if (steps >= PHI_LANES && s->blocks.single_steps == 0) {
            PHI_EACH_STAGE phi_refresh(s PHI_AND_STAGE, &table);
            phi_renew_lanes(s, &table);
            const int passes = phi_block(s, &table, (int)((double)PHI_PASSES * s->blocks.evaluations_per_stage + 0.5));
            phi_learn_from(s, passes);
            if (passes > 0) steps -= PHI_LANES;
        } else {
            if (s->blocks.single_steps > 0) --s->blocks.single_steps;
            status = phi_single(s);
            phi_end_march(&table);
            if (status == PHI_OK) --steps;
        }
    }
    if (s != NULL) phi_read_attitude(s);
    return status;
}

phi_status phi_step(phi_solver *s, double h)
{
    const phi_status status = phi_single_steps(s, h, 1);
    if (status == PHI_OK) phi_read_attitude(s);
    return status;
}
#endif
