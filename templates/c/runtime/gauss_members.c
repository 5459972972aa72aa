#ifndef PHI_FILE_GAUSS_MEMBERS
#define PHI_FILE_GAUSS_MEMBERS
#include <float.h>
#include <math.h>
#include <string.h>

#include "gauss.c"
#include "members.c"
#include "model.h"

/* ---- SIMD batches of members: Gauss steps ---- */
enum {
    PHI_GROUP = PHI_LANES, /* number of members, one in each lane */
    PHI_FEWEST = PHI_LANES > 4 ? 7 : 3 /* measured: fewer members are faster one after the other, with a stage in each lane */
};
/* Largest accepted error of the slowest member. With the larger PHI_SOLVED, the energy would drift by 1e-18 of its size
   in each step. */
#define PHI_GROUP_SOLVED (0.25 * PHI_SOLVED)

/* Values of the unknowns of all members, for each stage. */
typedef phi_lanes phi_batch[PHI_NODES][PHI_UNKNOWNS];

/* Members of an ensemble, one in each lane. */
typedef struct {
    phi_lanes x[PHI_POINT]; /* data at the start of a step, the coordinates first */
    phi_lanes carry[PHI_DIM], coef[PHI_COEFFICIENTS];
    phi_lanes weights[PHI_NODES][1]; /* weights h b_j of the stages */
    phi_batch increments[PHI_EARLIER];    /* stage increments of the last steps, in the frame at the end of the last step */
    int latest;    /* index of the last step in the array `increments` */
    int count;     /* number of steps in the array `increments` */
    int predictor; /* row of phi_prediction by which the next step is predicted */
    int age;       /* steps since the predictors were first compared; they are compared again after every PHI_TRIALS steps */
    int sweeps;    /* number of the first sweep whose change is measured */
    double rate;   /* factor by which the changes of a sweep shrink from one sweep to the next */
    int active[PHI_LANES];        /* whether the lane holds a member that has not failed */
    size_t steps_left[PHI_LANES]; /* number of steps that the member has still to make outside of the group */
    PHI_GAUGES_OF_MEMBERS
#if PHI_TIMED
    double t0[PHI_LANES], h[PHI_LANES]; /* initial times and steps */
    size_t steps;                       /* number of steps made */
#endif
} phi_group;

/* Predict the unknowns of stage i from the stage increments of the last steps. `predictor` is an index of
   phi_prediction. */
static void phi_group_predict(phi_group *group, int predictor, int i, phi_lanes z[PHI_UNKNOWNS])
{
    phi_lanes older[PHI_UNKNOWNS];
    phi_mix_members(phi_prediction[predictor], i, group->increments[group->latest], z);
    if (predictor + 1 == PHI_PREDICTORS) return; /* the last predictor uses the last step only */
    phi_mix_members(phi_prediction[predictor] + PHI_NODES, i, group->increments[1 - group->latest], older);
    for (int k = 0; k < PHI_UNKNOWNS; ++k) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) z[k][lane] += older[k][lane];
    }
}

/* Add the squared differences between two arrays of unknowns to sum. Those of coordinates are first multiplied by
   scale. */
static inline void phi_group_compare(const phi_lanes scale, phi_lanes before[PHI_UNKNOWNS], phi_lanes after[PHI_UNKNOWNS], phi_lanes sum)
{
    for (int k = 0; k < PHI_UNKNOWNS; ++k) {
        const double *old = before[k], *now = after[k];
        if (k < PHI_PLAIN) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) sum[lane] += scale[lane] * ((now[lane] - old[lane]) * (now[lane] - old[lane]));
        } else {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) sum[lane] += (now[lane] - old[lane]) * (now[lane] - old[lane]);
        }
    }
}

/* Compute the weights of squared changes of coordinates in each lane: 1 / |x|^2, or 1 / |increments|^2 if x = 0. */
static void phi_group_scale(const phi_group *group, phi_batch now, phi_lanes scale)
{
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        double square = DBL_MIN;
        for (int i = 0; i < PHI_DIM; ++i) square += group->x[i][lane] * group->x[i][lane];
        for (int i = 0; i < PHI_NODES && square <= DBL_MIN; ++i)
            for (int k = 0; k < PHI_PLAIN; ++k) square += now[i][k][lane] * now[i][k][lane];
        scale[lane] = 1.0 / square;
    }
}

/* Number of the predictor whose prediction is nearest to the final unknowns z of the active members. */
static int phi_group_best_predictor(phi_group *group, const phi_lanes scale, phi_batch z)
{
    phi_lanes predicted[PHI_UNKNOWNS];
    double least = HUGE_VAL;
    int best = PHI_PREDICTORS - 1;
    for (int predictor = 0; predictor < PHI_PREDICTORS; ++predictor) {
        phi_lanes sum = { 0.0 };
        double change = 0.0;
        for (int i = 0; i < PHI_NODES; ++i) {
            phi_group_predict(group, predictor, i, predicted);
            phi_group_compare(scale, predicted, z[i], sum);
        }
        for (int lane = 0; lane < PHI_LANES; ++lane)
            if (group->active[lane]) change = fmax(change, sum[lane]);
        if (change < least) {
            least = change;
            best = predictor;
        }
    }
    return best;
}

/* Make a fixed-point sweep over all stages: compute the increments `now` from the unknowns z. Unless `sum` is NULL, add
   the squared changes of the increments to `sum`. */
static void phi_group_sweep(phi_group *group, const phi_lanes scale, phi_batch z, phi_batch now, double *sum)
{
    phi_lanes next[PHI_UNKNOWNS];
    for (int i = 0; i < PHI_NODES; ++i) {
        if (sum == NULL) {
            phi_member_field_lanes(group->coef, group->x, z[i], group->weights[i], now[i]);
            continue;
        }
        phi_member_field_lanes(group->coef, group->x, z[i], group->weights[i], next);
        phi_group_compare(scale, now[i], next, sum);
        memcpy(now[i], next, sizeof next);
    }
}

/* Largest squared change of an active member, as a mean over the stages. Members with values that are not finite become
   inactive. */
static double phi_group_change(phi_group *group, const phi_lanes sum)
{
    double largest = 0.0;
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        group->active[lane] = group->active[lane] && isfinite(sum[lane]);
        if (group->active[lane]) largest = fmax(largest, sum[lane]);
    }
    return largest / (double)PHI_NODES;
}

/* Compute the starting values z of the unknowns: a prediction, or 0 in the first step. */
static void phi_group_begin(phi_group *group, phi_batch z)
{
    const int predictor = group->count < PHI_EARLIER ? PHI_PREDICTORS - 1 : group->predictor;
    if (group->count == 0) {
        memset(z, 0, sizeof(phi_batch));
        group->rate = 0.5;
        group->sweeps = 2;
        return;
    }
    for (int i = 0; i < PHI_NODES; ++i) phi_group_predict(group, predictor, i, z[i]);
}

/* Solve the equations of a step for the increments `now` of all stages, by fixed-point sweeps, until the slowest member has
   converged. Members that do not converge become inactive. */
static void phi_group_solve(phi_group *group, phi_batch now)
{
    phi_batch z;
    phi_lanes scale = { 0.0 }, sum;
    phi_progress progress = { HUGE_VAL, 0, 0 };
    int judgement = 0;
    phi_group_begin(group, z);
    for (int sweep = 1; sweep <= PHI_MAX_SWEEPS; ++sweep) {
        const int tested = sweep >= group->sweeps;
        if (tested && sweep == group->sweeps) phi_group_scale(group, now, scale);
        memset(sum, 0, sizeof sum);
        phi_group_sweep(group, scale, z, now, tested ? sum : NULL);
        if (tested) {
            const double square = phi_group_change(group, sum);
            const int solved = square * (group->rate * group->rate) <= PHI_GROUP_SOLVED * PHI_GROUP_SOLVED;
            judgement = solved ? 1 : phi_judge(&group->rate, &group->sweeps, &progress, sweep, sqrt(square));
            if (solved) group->sweeps = square <= 16.0 * PHI_GROUP_SOLVED * PHI_GROUP_SOLVED ? sweep - 1 : sweep;
            if (group->sweeps < 2) group->sweeps = 2;
            if (judgement != 0) break;
        }
        for (int i = 0; i < PHI_NODES; ++i) phi_mix_members(phi_mixing, i, now, z[i]);
    }
    for (int lane = 0; lane < PHI_LANES && judgement <= 0; ++lane)
        group->active[lane] = group->active[lane] && sum[lane] <= (double)PHI_NODES * (PHI_NEARLY_ROUNDING * PHI_NEARLY_ROUNDING);
    if (group->count == PHI_EARLIER && group->age++ % PHI_TRIALS == 0)
        group->predictor = phi_group_best_predictor(group, scale, z);
}

/* Store the stage increments of a step with this start and end, to predict the next step. */
static void phi_group_remember(phi_group *group, phi_lanes start[PHI_POINT], phi_lanes end[PHI_UNKNOWNS], phi_batch now)
{
    const int older = group->latest, latest = PHI_EARLIER - 1 - older;
#if PHI_FRAMED
    phi_lanes last[PHI_UNKNOWNS];
    for (int i = 0; i < PHI_NODES; ++i) {
        memcpy(last, group->increments[older][i], sizeof last);
        phi_member_frame_lanes(group->coef, start, end, last, group->increments[older][i]);
        phi_member_frame_lanes(group->coef, start, end, now[i], group->increments[latest][i]);
    }
#else
    (void)start;
    (void)end;
    memcpy(group->increments[latest], now, sizeof(phi_batch));
#endif
    group->latest = latest;
    if (group->count < PHI_EARLIER) ++group->count;
}

/* Add the changes to x in compensated arithmetic. Members that failed, or whose new state is not finite, keep the old
   state. */
static void phi_group_advance(phi_group *group, phi_lanes change[PHI_DIM])
{
    phi_lanes x[PHI_DIM], carry[PHI_DIM], zero = { 0.0 };
    for (int i = 0; i < PHI_DIM; ++i) {
        const double *was = group->x[i], *rest = group->carry[i], *by = change[i];
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            const double total = by[lane] + rest[lane], more = total - by[lane];
            const double sum = was[lane] + total, added = sum - was[lane];
            x[i][lane] = sum;
            zero[lane] += sum - sum; /* sum - sum is 0 if the sum is finite, else NaN */
            carry[i][lane] = ((was[lane] - (sum - added)) + (total - added)) + ((by[lane] - (total - more)) + (rest[lane] - more));
        }
    }
    for (int lane = 0; lane < PHI_LANES; ++lane) group->active[lane] = group->active[lane] && zero[lane] == 0.0;
    for (int i = 0; i < PHI_DIM; ++i)
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            group->x[i][lane] = group->active[lane] ? x[i][lane] : group->x[i][lane];
            group->carry[i][lane] = group->active[lane] ? carry[i][lane] : group->carry[i][lane];
        }
}

#if PHI_MONITOR
/* Members become inactive if the physical time of their step does not have the sign of h. */
static void phi_group_pass(phi_group *group, phi_batch now)
{
    phi_lanes z[PHI_UNKNOWNS], elapsed[1], sum = { 0.0 };
    for (int i = 0; i < PHI_NODES; ++i) {
        phi_mix_members(phi_mixing, i, now, z);
        phi_member_elapsed_lanes(group->coef, group->x, z, group->weights[i], elapsed);
        for (int lane = 0; lane < PHI_LANES; ++lane) sum[lane] += elapsed[0][lane];
    }
    for (int lane = 0; lane < PHI_LANES; ++lane)
        group->active[lane] = group->active[lane] && sum[lane] * group->weights[0][0][lane] > 0.0;
}

#endif
#if PHI_TIMED
/* Update the time of each member to the end of a step. */
static void phi_group_pass(phi_group *group)
{
    ++group->steps;
    for (int lane = 0; lane < PHI_LANES; ++lane)
        group->x[PHI_DIM][lane] = group->t0[lane] + (double)group->steps * group->h[lane];
}

#endif
/* Make one step of all active members. Returns the number of members that are still active. */
static int phi_group_step(phi_group *group, size_t remaining)
{
    phi_batch now;
    phi_lanes start[PHI_POINT], end[PHI_UNKNOWNS], change[PHI_DIM];
    int active = 0;
    memset(now, 0, sizeof now);
    memset(end, 0, sizeof end);
    memcpy(start, group->x, sizeof start);
    phi_group_solve(group, now);
    for (int i = 0; i < PHI_NODES; ++i)
        for (int k = 0; k < PHI_UNKNOWNS; ++k) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) end[k][lane] += now[i][k][lane];
        }
    phi_member_change_lanes(group->coef, group->x, end, change);
#if PHI_MONITOR
    phi_group_pass(group, now);
#endif
    phi_group_advance(group, change);
    phi_group_remember(group, start, end, now);
#if PHI_TIMED
    phi_group_pass(group);
#endif
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        if (!group->active[lane] && group->steps_left[lane] == 0) group->steps_left[lane] = remaining;
        active += group->active[lane];
    }
    return active;
}

/* Assign a member to a lane: its state, its coefficients and its step. */
static phi_status phi_group_join(phi_group *group, int lane, const phi_members *all, size_t m)
{
    phi_solver s;
    double x[PHI_DIM];
    const phi_status status = phi_take_member(all, m, x, &s);
    for (int i = 0; i < PHI_DIM; ++i) group->x[i][lane] = x[i];
    if (status != PHI_OK) return status;
    for (int k = 0; k < PHI_COEFFICIENTS; ++k) group->coef[k][lane] = s.coef[k];
    for (int i = 0; i < PHI_NODES; ++i) group->weights[i][0][lane] = s.h * phi_weights[i];
    PHI_COPY_GAUGE(group->gauge[lane], s.gauge)
#if PHI_TIMED
    group->x[PHI_DIM][lane] = group->t0[lane] = s.t;
    group->h[lane] = s.h;
#endif
    group->active[lane] = 1;
    return status;
}
#endif
