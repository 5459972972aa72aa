#ifndef PHI_FILE_GROUPS
#define PHI_FILE_GROUPS
#include <math.h>
#include <string.h>

#include "blocks.c"
#include "members.c"
#include "model.h"

/* ---- SIMD batches of members: implicit steps ---- */
enum {
    PHI_GROUP = PHI_LANES,              /* number of members of a group, one in each lane */
    PHI_FEWEST = 3,                     /* smallest number of members whose joint integration is faster; measured */
    PHI_GROUP_REPAY = 5000 * PHI_DIM,   /* number of steps that repay a fit; measured. It is large, since a fit predicts one solution, not eight as in a block */
    PHI_REFIT_WAIT = 100 * PHI_REPAY    /* if recurrences did not help: number of steps that take several iterations until the next fit */
};

/* Members of an ensemble, one in each lane. */
typedef struct {
    phi_lanes x[PHI_DIM], carry[PHI_DIM], PHI_OF(coef, PHI_STAGES)[PHI_COEFFICIENTS];
    phi_lanes PHI_OF(past, PHI_STAGES)[PHI_REMEMBERED][PHI_DIM]; /* past solutions of each stage, in a ring buffer */
    phi_lanes PHI_OF(weight, PHI_STAGES)[PHI_WINDOW][PHI_DIM]; /* weights of past solutions in the recurrences, the latest solution first */
    int latest;     /* index of the latest solutions in the array `past` */
    int count;      /* number of solutions in the array `past` */
    int PHI_OF(extrapolation_order, PHI_STAGES); /* number of solutions that the extrapolation uses */
    int PHI_OF(recurrence_terms, PHI_STAGES);    /* number of solutions that the recurrences use */
    int PHI_OF(use_recurrences, PHI_STAGES);     /* whether recurrences predict better than the extrapolation */
    int fits;               /* number of fits of the recurrences */
    int slow_steps;         /* recent steps that took more than one iteration */
    int slow_steps_allowed; /* value of slow_steps at which the recurrences are fitted again */
    int active[PHI_LANES];  /* whether the lane holds a member that has not failed */
    size_t steps_left[PHI_LANES]; /* number of steps that the member has still to make outside of the group */
    PHI_GAUGES_OF_MEMBERS
} phi_group;

/* Return the solutions of a stage, k steps before the last step. */
static phi_lanes *phi_group_past(phi_group *group PHI_AND_INT_STAGE, int k)
{
    const int row = group->latest + k;
    return PHI_OF(group->past, stage)[row < PHI_REMEMBERED ? row : row - PHI_REMEMBERED];
}

/* Predict the solutions of a stage by the recurrences of the members. */
static void phi_group_foresee(phi_group *group PHI_AND_INT_STAGE, phi_lanes y[restrict PHI_DIM])
{
    memset(y, 0, PHI_DIM * sizeof y[0]);
    for (int k = 0; k < PHI_OF(group->recurrence_terms, stage); ++k) {
        phi_lanes *past = phi_group_past(group PHI_AND_STAGE, k), *weight = PHI_OF(group->weight, stage)[k];
        for (int i = 0; i < PHI_DIM; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) y[i][lane] += weight[i][lane] * past[i][lane];
        }
    }
}

/* Predict the solutions of a stage by polynomial extrapolation of past ones, or by x if there are none. */
static void phi_group_extrapolate(phi_group *group PHI_AND_INT_STAGE, phi_lanes y[restrict PHI_DIM])
{
    const int order = PHI_OF(group->extrapolation_order, stage);
    double binomial = -1.0;
    memcpy(y, group->x, PHI_DIM * sizeof y[0]);
    if (order > 0) memset(y, 0, PHI_DIM * sizeof y[0]);
    for (int k = 0; k < order; ++k) {
        phi_lanes *past = phi_group_past(group PHI_AND_STAGE, k);
        binomial *= -(double)(order - k) / (k + 1);
        for (int i = 0; i < PHI_DIM; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) y[i][lane] += binomial * past[i][lane];
        }
    }
}

/* Sum of the absolute values of all components of y, over the active members. */
static double phi_group_sum(const phi_group *group, phi_lanes y[PHI_DIM])
{
    double sum = 0.0;
    for (int i = 0; i < PHI_DIM; ++i)
        for (int lane = 0; lane < PHI_LANES; ++lane) sum += group->active[lane] ? fabs(y[i][lane]) : 0.0;
    return sum;
}

static void phi_group_subtract(phi_lanes y[restrict PHI_DIM], phi_lanes other[restrict PHI_DIM])
{
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) y[i][lane] -= other[i][lane];
    }
}

/* For a stage with solutions y, select the predictor that would have predicted y best. */
static void phi_group_judge(phi_group *group PHI_AND_INT_STAGE, phi_lanes y[PHI_DIM])
{
    phi_lanes row[PHI_HISTORY + 1][PHI_DIM];
    const int rows = group->count < PHI_HISTORY ? group->count : PHI_HISTORY;
    double least = HUGE_VAL;
    memcpy(row[0], y, sizeof row[0]);
    for (int k = 0; k < rows; ++k) memcpy(row[k + 1], phi_group_past(group PHI_AND_STAGE, k), sizeof row[0]);
    if (PHI_OF(group->extrapolation_order, stage) == 0) PHI_OF(group->extrapolation_order, stage) = 1;
    for (int order = 1; order <= rows; ++order) { /* row[0] becomes the backward difference of this order */
        for (int k = 0; k <= rows - order; ++k) phi_group_subtract(row[k], row[k + 1]);
        const double size = phi_group_sum(group, row[0]);
        if (size < least) {
            least = size;
            PHI_OF(group->extrapolation_order, stage) = order;
        }
    }
    if (PHI_OF(group->recurrence_terms, stage) == 0) return;
    phi_group_foresee(group PHI_AND_STAGE, row[0]);
    phi_group_subtract(row[0], y);
    PHI_OF(group->use_recurrences, stage) = phi_group_sum(group, row[0]) <= least;
}

/* Fit the recurrences of all members. The number of slow steps until the next fit grows with every fit, and is large if the
   last fit did not help. */
static void phi_group_fit(phi_group *group)
{
    phi_history member;
    const int helped = group->fits == 0 || PHI_OF(group->use_recurrences, 0);
    member.count = PHI_REMEMBERED;
    PHI_EACH_STAGE {
        int fitted = 1;
        PHI_OF(group->recurrence_terms, stage) = 0;
        for (int lane = 0; lane < PHI_LANES; ++lane)
            for (int i = 0; i < PHI_DIM && group->active[lane] && fitted; ++i) {
                for (int k = 0; k < PHI_REMEMBERED; ++k)
                    member.past[PHI_REMEMBERED - 1 - k][i] = phi_group_past(group PHI_AND_STAGE, k)[i][lane];
                const int terms = phi_train(&member, i);
                fitted = terms > 0;
                if (terms > PHI_OF(group->recurrence_terms, stage)) PHI_OF(group->recurrence_terms, stage) = terms;
                for (int k = 0; k < PHI_WINDOW; ++k) PHI_OF(group->weight, stage)[k][i][lane] = member.weight[k][i][0];
            }
        if (!fitted) PHI_OF(group->recurrence_terms, stage) = 0;
        PHI_OF(group->use_recurrences, stage) = fitted;
    }
    ++group->fits;
    group->slow_steps = 0;
    group->slow_steps_allowed = helped && group->slow_steps_allowed < PHI_LONG_WAIT / 2 ? 2 * group->slow_steps_allowed + PHI_REPAY : PHI_REFIT_WAIT;
}

/* In each lane whose prediction y is not near `last`, set y to `last`: from elsewhere, the iteration could find a solution
   unrelated to the motion. */
static void phi_stay_near(phi_lanes y[restrict PHI_DIM], phi_lanes last[restrict PHI_DIM])
{
    phi_lanes distance = { 0.0 }, size = { 0.0 };
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            distance[lane] += fabs(y[i][lane] - last[i][lane]);
            size[lane] += fabs(last[i][lane]);
        }
    }
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane)
            y[i][lane] = distance[lane] <= PHI_REACH * size[lane] ? y[i][lane] : last[i][lane];
    }
}

/* Number of active lanes whose expected corrections are still above the tolerance. Lanes with values that are not finite
   become inactive. */
static int phi_group_open(phi_group *group, const phi_lanes size, const phi_lanes left)
{
    int open = 0;
    if (phi_largest(left) <= PHI_TOLERANCE) return 0;
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        if (!isfinite(size[lane])) group->active[lane] = 0;
        open += group->active[lane] && !(left[lane] <= PHI_TOLERANCE);
    }
    return open;
}

/* Predict the solutions of a stage, by recurrences or extrapolation. Where the prediction is not near the state, the state
   takes its place. */
static void phi_group_predict(phi_group *group PHI_AND_INT_STAGE, phi_lanes y[PHI_DIM])
{
    if (PHI_OF(group->use_recurrences, stage)) phi_group_foresee(group PHI_AND_STAGE, y);
    else phi_group_extrapolate(group PHI_AND_STAGE, y);
    phi_stay_near(y, group->x);
}

/* Solve the equation of a stage by Newton's method, until all lanes have converged. Returns the number of iterations. After
   the largest allowed number, lanes that have not converged become inactive. */
static int phi_group_solve(phi_group *group PHI_AND_INT_STAGE, phi_model *model)
{
    phi_lanes unit[PHI_DIM], size, before, left;
    double largest = HUGE_VAL;
    int iterations = 0, open = 1;
    for (int lane = 0; lane < PHI_LANES; ++lane) size[lane] = HUGE_VAL;
    phi_group_predict(group PHI_AND_STAGE, model->y);
    for (; open > 0 && iterations < PHI_MAX_ITERATIONS; ++iterations) {
        memcpy(before, size, sizeof size);
        const int matrices = largest > PHI_FROZEN;
        phi_update(PHI_OF(group->coef, stage), model, matrices);
        if (matrices) phi_measure(model PHI_AND_ONE_STAGE, unit);
        for (int i = 0; i < PHI_DIM; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane)
                model->residual[i][lane] =
                    ((model->y[i][lane] - group->x[i][lane]) + model->displacement[i][lane]) - group->carry[i][lane];
        }
        phi_correct(model, unit, size);
        phi_leave(size, before, left);
        open = phi_group_open(group, size, left);
        largest = phi_largest(size);
    }
    for (int lane = 0; lane < PHI_LANES && open > 0; ++lane)
        group->active[lane] = group->active[lane] && left[lane] <= PHI_TOLERANCE;
    return iterations;
}

/* Add the increments of a stage to x in compensated arithmetic. The effect of the last correction of y on the increment is
   included to first order. */
static void phi_group_advance(phi_lanes x[restrict PHI_DIM], phi_lanes carry[restrict PHI_DIM], phi_model *model)
{
    PHI_GAIN(model)
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            const double change = model->increment[i][lane], sum = x[i][lane] + change, added = sum - x[i][lane];
            const double lost = (x[i][lane] - (sum - added)) + (change - added);
            const double rest = lost + (carry[i][lane] - PHI_GAINED(model)[i][lane]);
            x[i][lane] = sum + rest;
            carry[i][lane] = rest - (x[i][lane] - sum);
        }
    }
}

/* Give the old state x back to members that failed, or whose new state is not finite or not near the old one; they become
   inactive. Returns the number of active members. */
static int phi_group_leave(phi_group *group, phi_lanes x[PHI_DIM], phi_lanes carry[PHI_DIM],
    size_t remaining)
{
    phi_lanes distance = { 0.0 }, size = { 0.0 }, bad;
    int active = 0;
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            distance[lane] += fabs(group->x[i][lane] - x[i][lane]);
            size[lane] += fabs(x[i][lane]);
        }
    }
    for (int lane = 0; lane < PHI_LANES; ++lane) bad[lane] = distance[lane] <= PHI_REACH * size[lane] ? 0.0 : 1.0;
    for (int lane = 0; lane < PHI_LANES; ++lane) active += group->active[lane];
    if (active == PHI_LANES && !(phi_largest(bad) > 0.0)) return active;
    active = 0;
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        group->active[lane] = group->active[lane] && !(bad[lane] > 0.0);
        active += group->active[lane];
        for (int i = 0; i < PHI_DIM && !group->active[lane]; ++i) {
            group->x[i][lane] = x[i][lane];
            group->carry[i][lane] = carry[i][lane];
        }
        if (!group->active[lane] && group->steps_left[lane] == 0) group->steps_left[lane] = remaining;
    }
    return active;
}

/* Make one step of all active members. Returns the number of members that are still active. */
static int phi_group_step(phi_group *group, size_t remaining)
{
    phi_lanes x[PHI_DIM], carry[PHI_DIM];
    phi_model model;
    const int next = (group->latest > 0 ? group->latest : PHI_REMEMBERED) - 1;
    int slow = 0;
    memcpy(x, group->x, sizeof x);
    memcpy(carry, group->carry, sizeof carry);
    PHI_EACH_STAGE {
        const int iterations = phi_group_solve(group PHI_AND_STAGE, &model);
        phi_group_advance(group->x, group->carry, &model);
        slow = slow || iterations > 1;
        if ((iterations > 1 && next % PHI_HISTORY == 0) || group->count < PHI_HISTORY)
            phi_group_judge(group PHI_AND_STAGE, model.y);
        memcpy(PHI_OF(group->past, stage)[next], model.y, sizeof model.y);
    }
    group->latest = next;
    if (group->count < PHI_REMEMBERED) ++group->count;
    group->slow_steps = slow ? group->slow_steps + 1 : 0;
    if (group->slow_steps > group->slow_steps_allowed && group->count == PHI_REMEMBERED && remaining >= PHI_GROUP_REPAY)
        phi_group_fit(group);
    return phi_group_leave(group, x, carry, remaining);
}

/* Assign a member to a lane: its state and its coefficients. */
static phi_status phi_group_join(phi_group *group, int lane, const phi_members *all, size_t m)
{
    phi_solver s;
    double x[PHI_DIM];
    const phi_status status = phi_take_member(all, m, x, &s);
    for (int i = 0; i < PHI_DIM; ++i) group->x[i][lane] = x[i];
    if (status != PHI_OK) return status;
    PHI_EACH_STAGE
        for (int k = 0; k < PHI_COEFFICIENTS; ++k) PHI_OF(group->coef, stage)[k][lane] = PHI_OF(s.coef, stage)[k];
    PHI_COPY_GAUGE(group->gauge[lane], s.gauge)
    group->active[lane] = 1;
    return status;
}
#endif
