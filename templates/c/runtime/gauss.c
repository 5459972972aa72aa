#ifndef PHI_FILE_GAUSS
#define PHI_FILE_GAUSS
#include <float.h>
#include <math.h>
#include <string.h>

#include "algebra.c"
#include "attitude.c"
#include "model.h"
#if PHI_STAGED
#include "lanes.c"
#else
typedef double phi_lanes[PHI_WIDTH]; /* one value for each stage */
#define PHI_EACH_LANE

#endif
#include "gauss_tables.h"
#if PHI_STAGED
#include "model_lanes.h"
#endif

/* ---- The implicit step, by Gauss collocation ---- */
/* Copy the data at the start of a step, PHI_POINT numbers; the coordinates come first. */
static void phi_start(const phi_solver *s, double point[PHI_POINT])
{
    PHI_COPY(point, s->x, s->x, PHI_DIM);
#if PHI_TIMED
    point[PHI_DIM] = s->t;
#endif
#if PHI_LIFTED
    memcpy(point + PHI_POINT - PHI_LIFT, s->history.frame, sizeof s->history.frame);
#endif
}

/* Compute the sum of the increments of all stages. */
static void phi_end(phi_lanes *increments, double end[PHI_UNKNOWNS])
{
    for (int k = 0; k < PHI_UNKNOWNS; ++k) end[k] = phi_total(increments[k]);
}

/* Compute the increments of all stages: the weights h b_j times the vector field at the unknowns z. */
static inline void phi_slopes(const phi_solver *s, double point[PHI_POINT], phi_lanes *weights, phi_lanes *z, phi_lanes *increments)
{
#if PHI_STAGED
    phi_stage_field_lanes(s->coef, point, z, weights, increments);
#else
    double at[PHI_UNKNOWNS], increment[PHI_UNKNOWNS];
    for (int i = 0; i < PHI_NODES; ++i) {
        for (int k = 0; k < PHI_UNKNOWNS; ++k) at[k] = z[k][i];
        phi_stage_field(s->coef, point, at, &weights[0][i], increment);
        for (int k = 0; k < PHI_UNKNOWNS; ++k) increments[k][i] = increment[k];
    }
#endif
}

/* The collocation polynomial at a fraction of a step, minus its value at the end, is the sum of f_j times increment j.
   Compute the factors f_j: integrals of Lagrange polynomials from 1 to the fraction, divided by the weights, by sums of
   Legendre polynomials. */
static void phi_factors_at(double fraction, double factor[PHI_NODES])
{
    const double x = 2.0 * fraction - 1.0;
    double below = 1.0, here = x, node_below[PHI_NODES], node[PHI_NODES];
    for (int j = 0; j < PHI_NODES; ++j) {
        factor[j] = fraction - 1.0;
        node_below[j] = 1.0;
        node[j] = 2.0 * phi_nodes[j] - 1.0;
    }
    for (int k = 1; k < PHI_NODES; ++k) {
        const double b = (double)k / (double)(k + 1), a = 1.0 + b, above = a * x * here - b * below;
        for (int j = 0; j < PHI_NODES; ++j) {
            const double node_above = a * (2.0 * phi_nodes[j] - 1.0) * node[j] - b * node_below[j];
            factor[j] += 0.5 * node[j] * (above - below);
            node_below[j] = node[j];
            node[j] = node_above;
        }
        below = here;
        here = above;
    }
}

#include "gauss_reduced.c"
#include "gauss_all_unknowns.c"
#include "gauss_lifted.c"

#if PHI_STAGED
/* Weight of squared changes of coordinates: 1 / |x|^2, or 1 / |increments|^2 if x = 0. */
static double phi_scale(const double x[PHI_DIM], phi_lanes *increments)
{
    double square = DBL_MIN;
    for (int i = 0; i < PHI_DIM; ++i) square += x[i] * x[i];
    if (square <= DBL_MIN)
        for (int k = 0; k < PHI_PLAIN && k < PHI_ITERATED_COUNT; ++k)
            for (int i = 0; i < PHI_NODES; ++i) square += increments[k][i] * increments[k][i];
    return 1.0 / square;
}

/* Squared change of the unknowns by a sweep, as a mean over the stages. The first PHI_PLAIN unknowns have the weight
   `scale`. The others belong to the matrix or quaternion that moves the state, and have the weight element_scale. */
static inline double phi_change_of(double scale, double element_scale, int count, phi_lanes *before, phi_lanes *after)
{
    phi_lanes sum = { 0.0 };
    for (int k = 0; k < count; ++k) {
        const double *old = before[k], *now = after[k];
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_WIDTH; ++lane) sum[lane] += (now[lane] - old[lane]) * (now[lane] - old[lane]);
        if (k + 1 == (count < PHI_PLAIN ? count : PHI_PLAIN))
            for (int lane = 0; lane < PHI_WIDTH; ++lane) sum[lane] *= scale / element_scale;
    }
    return element_scale * (phi_total(sum) / (double)PHI_NODES);
}

/* Predict the values that sweeps read, from the stage increments of the last steps. `predictor` is an index of
   phi_prediction. */
static inline void phi_predict(phi_history *past, int predictor, phi_lanes reads[PHI_READ_COUNT])
{
    double(*last)[PHI_WIDTH] = past->increments[past->latest], (*older)[PHI_WIDTH] = past->increments[1 - past->latest];
    if (predictor + 1 < PHI_PREDICTORS)
        for (int r = 0; r < PHI_READ_COUNT; ++r) phi_mix_twice(phi_prediction[predictor], last[PHI_READ(r)], older[PHI_READ(r)], reads[r]);
    else /* the last predictor uses the last step only */
        for (int r = 0; r < PHI_READ_COUNT; ++r) phi_mix(phi_prediction[predictor], last[PHI_READ(r)], reads[r]);
}

/* Number of the predictor whose values are nearest to `reads`, the values that the last sweep has read. */
static int phi_best_predictor(phi_history *past, double scale, double element_scale, phi_lanes *reads)
{
    phi_lanes predicted[PHI_READ_COUNT];
    double least = HUGE_VAL;
    int best = PHI_PREDICTORS - 1;
    for (int predictor = 0; predictor < PHI_PREDICTORS; ++predictor) {
        phi_predict(past, predictor, predicted);
        const double change = phi_change_of(scale, element_scale, PHI_READ_COUNT, predicted, reads);
        if (change < least) {
            least = change;
            best = predictor;
        }
    }
    return best;
}

#else
/* Squared change of unknowns by a sweep, as a mean over stages. The first PHI_PLAIN changes are relative to |x|, or to
   the increments if x = 0; other unknowns have sizes near 1. */
static double phi_change_of(const double x[PHI_DIM], phi_lanes *before, phi_lanes *after)
{
    double square = DBL_MIN, sum[PHI_NODES] = { 0.0 };
    for (int i = 0; i < PHI_DIM; ++i) square += x[i] * x[i];
    if (square <= DBL_MIN)
        for (int k = 0; k < PHI_PLAIN; ++k)
            for (int i = 0; i < PHI_NODES; ++i) square += after[k][i] * after[k][i];
    for (int k = 0; k < PHI_UNKNOWNS; ++k)
        for (int i = 0; i < PHI_NODES; ++i) {
            sum[i] += (after[k][i] - before[k][i]) * (after[k][i] - before[k][i]);
            if (k + 1 == PHI_PLAIN) sum[i] *= 1.0 / square;
        }
    return phi_total(sum) / (double)PHI_NODES;
}

#endif
#if PHI_FRAMED
/* Transform the stage increments of a step that begins at `point` to the frame in which the next step starts. `end` is
   the sum of the increments. */
static void phi_to_next_frame(const phi_solver *s, double point[PHI_POINT], const double end[PHI_UNKNOWNS], phi_lanes *increments,
    double in_next_frame[PHI_UNKNOWNS][PHI_WIDTH])
{
#if PHI_STAGED
    phi_lanes in_frame[PHI_UNKNOWNS];
    phi_next_frame_lanes(s->coef, point, end, increments, in_frame);
    memcpy(in_next_frame, in_frame, sizeof in_frame); /* to a place that may be unaligned */
#else
    double increment[PHI_UNKNOWNS], in_frame[PHI_UNKNOWNS];
    for (int i = 0; i < PHI_NODES; ++i) {
        for (int k = 0; k < PHI_UNKNOWNS; ++k) increment[k] = increments[k][i];
        phi_next_frame(s->coef, point, end, increment, in_frame);
        for (int k = 0; k < PHI_UNKNOWNS; ++k) in_next_frame[k][i] = in_frame[k];
    }
#endif
}

#endif
/* To predict the next step, store the increments of a step that begins at `point`; `end` is their sum. */
static void phi_remember(phi_solver *s, double point[PHI_POINT], const double end[PHI_UNKNOWNS], phi_lanes *increments)
{
    phi_history *past = &s->history;
#if PHI_STAGED
    const int older = past->latest;
    past->latest = PHI_EARLIER - 1 - older;
    if (s->h != past->h) past->count = 0; /* predictors need steps of equal size */
#endif
    past->h = s->h;
    past->kicked = 0;
#if PHI_FRAMED
#if PHI_STAGED
    phi_lanes last[PHI_UNKNOWNS];
    memcpy(last, past->increments[older], sizeof last);
    phi_to_next_frame(s, point, end, last, past->increments[older]);
#endif
    phi_to_next_frame(s, point, end, increments, PHI_LAST_INCREMENTS(past));
#if PHI_ADJOINT
    PHI_COPY_STAGES(past->solved, increments, past->solved);
#endif
#else
    (void)point;
    (void)end;
    PHI_COPY_STAGES(PHI_LAST_INCREMENTS(past), increments, PHI_LAST_INCREMENTS(past));
#endif
#if PHI_STAGED
    if (past->count < PHI_EARLIER) ++past->count;
#else
    past->count = 1;
#endif
}

#include "gauss_policy.h"

/* The last change; how many changes grew in a row; how many changes grew near rounding level. */
typedef struct {
    double last;
    int rising, rises;
} phi_progress;

/* Convergence test: 1 at rounding level, 0 to continue, -1 if too many changes grew. Updates *usual (the factor by
   which changes shrink) and *first (the first sweep of the next step whose change is measured). */
static int phi_judge(double *usual, int *first, phi_progress *sweeps, int sweep, double change)
{
    const double rate = change / sweeps->last;
    if (rate > 0.0 && rate < 1.0 && change > PHI_NEARLY_ROUNDING) *usual = 0.7 * *usual + 0.3 * rate;
    const int slow = rate >= 1.0 || rate > fmax(PHI_STALLED, 1.5 * *usual);
    if (rate >= 1.0 && change <= PHI_NEARLY_ROUNDING) ++sweeps->rises;
    sweeps->last = change;
    if ((slow && change <= PHI_ROUNDING) || sweeps->rises > 1) {
        /* fewer sweeps may suffice: an earlier change may have been at rounding level already */
        *first = (sweep == *first || rate > 2.0 * *usual ? *first : sweep) - 1;
        return 1;
    }
    sweeps->rising = rate >= 1.0 ? sweeps->rising + 1 : 0; /* changes may grow at first, in transients, for as many sweeps as there are stages */
    return sweeps->rising < (int)PHI_NODES + PHI_MOST_RISING ? 0 : -1;
}

/* Solve the equations of a step for the increments of all stages, by fixed-point sweeps from the prediction. The
   change by a sweep is not measured before the sweep that is expected to be the last. */
static phi_status phi_collocate(phi_solver *s, double point[PHI_POINT], phi_lanes *increments)
{
    phi_history *past = &s->history;
    phi_lanes z[PHI_READ_COUNT], next[PHI_ITERATED_COUNT], factors[PHI_FACTOR_COUNT] = { { 0.0 } };
    PHI_ITERATES(now, increments)
    phi_progress progress = { HUGE_VAL, 0, 0 };
    PHI_SET_FACTORS(s->h, factors);
    if (past->count == 0 || s->h != past->h) {
        PHI_CLEAR_STAGES(z);
        if (past->count > 0 && fabs(s->h) <= fabs(past->h)) phi_predict_at(past, s->h / past->h, z);
#if PHI_STAGED
        if (past->count > 1) past->count = 1;
#endif
        past->rate = 0.5;
        past->sweeps = 2;
    } else {
        PHI_PREDICT(past, z);
    }
    for (int sweep = 1; sweep <= PHI_MAX_SWEEPS; ++sweep) {
        const int tested = sweep >= past->sweeps;
        PHI_SWEEP(s, point, factors, z, tested ? next : now);
        if (tested) {
#if PHI_STAGED
            const double scale = phi_scale(s->x, next), element_scale = PHI_ELEMENT_SCALE(s);
            const double square = phi_change_of(scale, element_scale, PHI_ITERATED_COUNT, now, next);
#else
            const double square = phi_change_of(s->x, now, next);
#endif
            const int solved = square * (past->rate * past->rate) <= PHI_SOLVED * PHI_SOLVED;
            const int judgement = solved ? 1 : phi_judge(&past->rate, &past->sweeps, &progress, sweep, sqrt(square));
            PHI_COPY_STAGES(now, next, next);
            if (!isfinite(square)) return PHI_NOT_FINITE;
            if (judgement < 0) return PHI_NO_CONVERGENCE;
            if (judgement > 0) {
                /* the change by this sweep is nearly the error before the sweep; if the change is small, the sweep was not needed */
                if (solved) past->sweeps = square <= 16.0 * PHI_SOLVED * PHI_SOLVED ? sweep - 1 : sweep;
                if (past->sweeps < 2) past->sweeps = 2;
#if PHI_STAGED
                if (past->count == PHI_EARLIER && past->age++ % PHI_TRIALS == 0) past->predictor = phi_best_predictor(past, scale, element_scale, z);
#endif
                s->evaluations += (size_t)sweep;
                phi_complete_stages(s, point, factors, now, z, increments);
                return PHI_OK;
            }
        }
        PHI_READ_INCREMENTS(now, z);
    }
    return PHI_NO_CONVERGENCE;
}

#if PHI_MONITOR
/* Physical time that passes in a step: the integral of dt/dtau, by the values at its stages. */
static double phi_time_of(const phi_solver *s, double point[PHI_POINT], phi_lanes *increments)
{
    double sum = 0.0;
    phi_lanes z[PHI_UNKNOWNS], weights[1] = { { 0.0 } };
    for (int i = 0; i < PHI_NODES; ++i) weights[0][i] = s->h * phi_weights[i];
    phi_mixed(phi_mixing, increments, z);
#if PHI_STAGED
    phi_lanes elapsed[1];
    phi_elapsed_lanes(s->coef, point, z, weights, elapsed);
    for (int i = 0; i < PHI_NODES; ++i) sum += elapsed[0][i];
#else
    double at[PHI_UNKNOWNS], elapsed[1];
    for (int i = 0; i < PHI_NODES; ++i) {
        for (int k = 0; k < PHI_UNKNOWNS; ++k) at[k] = z[k][i];
        phi_elapsed(s->coef, point, at, &weights[0][i], elapsed);
        sum += elapsed[0];
    }
#endif
    return sum;
}

#endif
/* Make one step. If it fails, the state is unchanged. */
static phi_status phi_attempt(phi_solver *s)
{
    double point[PHI_POINT], end[PHI_UNKNOWNS], change[PHI_DIM];
    phi_lanes increments[PHI_UNKNOWNS];
    phi_lift(s);
    phi_start(s, point);
    const phi_status status = phi_collocate(s, point, increments);
    if (status != PHI_OK) return status;
    phi_end(increments, end);
    phi_end_followers(s, point, increments, end);
    phi_stage_change(s->coef, point, end, change);
#if PHI_MONITOR
    const double elapsed = phi_time_of(s, point, increments);
    if (!(elapsed * s->h > 0.0)) return PHI_NOT_FINITE;
#endif
    if (!phi_advance(s, change, s->carry)) return PHI_NOT_FINITE;
    phi_move_frames(s, end);
    PHI_PASS(s, elapsed)
    phi_remember(s, point, end, increments);
#if PHI_ATTITUDE
    double factor[PHI_ELEMENT];
    phi_turn(s->coef, end, factor);
    phi_turn_by(s, factor PHI_AND_ASIDE(s->aside));
#endif
    return PHI_OK;
}
#endif
