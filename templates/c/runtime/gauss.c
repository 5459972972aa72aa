#ifndef PHI_FILE_GAUSS
#define PHI_FILE_GAUSS
#include <float.h>
#include <math.h>
#include <string.h>

#include "algebra.c"
#include "model.h"
#if PHI_STAGED
#include "lanes.c"
#else
typedef double phi_lanes[PHI_WIDTH]; /* a value at each stage */
#define PHI_EACH_LANE

#endif
#include "gauss_tables.h"
#if PHI_STAGED
#include "model_lanes.h"
#endif

/* ---- The implicit step, by Gauss collocation ---- */
/* Where a step starts: the coordinates, and the time if H depends on it. */
static void phi_start(const phi_solver *s, double point[PHI_POINT])
{
    PHI_COPY(point, s->x, s->x, PHI_DIM);
#if PHI_TIMED
    point[PHI_DIM] = s->t;
#endif
}

/* The sum of the moves of all stages. */
static void phi_end(phi_lanes *moves, double end[PHI_UNKNOWNS])
{
    for (int k = 0; k < PHI_UNKNOWNS; ++k) {
        end[k] = 0.0;
        for (int i = 0; i < PHI_NODES; ++i) end[k] += moves[k][i];
    }
}

/* h b_j times the vector field at all stages, where the unknowns are z; the weights are h b_j. */
static inline void phi_slopes(const phi_solver *s, double point[PHI_POINT], phi_lanes *weights, phi_lanes *z, phi_lanes *moves)
{
#if PHI_STAGED
    phi_stage_field_lanes(s->coef, point, z, weights, moves);
#else
    double at[PHI_UNKNOWNS], move[PHI_UNKNOWNS];
    for (int i = 0; i < PHI_NODES; ++i) {
        for (int k = 0; k < PHI_UNKNOWNS; ++k) at[k] = z[k][i];
        phi_stage_field(s->coef, point, at, &weights[0][i], move);
        for (int k = 0; k < PHI_UNKNOWNS; ++k) moves[k][i] = move[k];
    }
#endif
}

/* The square of the size of coordinates, that of x; where x is 0 that of the moves. */
static double phi_square(const double x[PHI_DIM], phi_lanes *moves)
{
    double square = DBL_MIN;
    for (int i = 0; i < PHI_DIM; ++i) square += x[i] * x[i];
    if (square <= DBL_MIN)
        for (int k = 0; k < PHI_PLAIN; ++k)
            for (int i = 0; i < PHI_NODES; ++i) square += moves[k][i] * moves[k][i];
    return square;
}

/* The largest change at any stage, in sizes of the unknowns: of coordinates that of x, of group elements 1. */
static double phi_change_of(double square, phi_lanes *before, phi_lanes *after)
{
    double largest = 0.0;
    phi_lanes sum = { 0.0 };
    for (int k = 0; k < PHI_UNKNOWNS; ++k) {
        const double *old = before[k], *now = after[k], scale = k < PHI_PLAIN ? 1.0 / square : 1.0;
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_WIDTH; ++lane) sum[lane] += (now[lane] - old[lane]) * (now[lane] - old[lane]) * scale;
    }
    for (int i = 0; i < PHI_NODES; ++i)
        if (!(sum[i] <= largest)) largest = sum[i]; /* or not a number */
    return sqrt(largest);
}

/* The moves of the last step, as seen from its end, where this one starts. */
static void phi_seen(const phi_solver *s, phi_lanes *seen)
{
#if PHI_FRAMED
    double end[PHI_UNKNOWNS];
    phi_lanes moves[PHI_UNKNOWNS];
    PHI_COPY_STAGES(moves, s->history.moves, moves); /* which need not be aligned as lanes are */
    phi_end(moves, end);
#if PHI_STAGED
    phi_next_frame_lanes(s->coef, end, moves, seen);
#else
    double move[PHI_UNKNOWNS], found[PHI_UNKNOWNS];
    for (int i = 0; i < PHI_NODES; ++i) {
        for (int k = 0; k < PHI_UNKNOWNS; ++k) move[k] = moves[k][i];
        phi_next_frame(s->coef, end, move, found);
        for (int k = 0; k < PHI_UNKNOWNS; ++k) seen[k][i] = found[k];
    }
#endif
#else
    PHI_COPY_STAGES(seen, s->history.moves, s->history.moves); /* which need not be aligned as lanes are */
#endif
}

#include "gauss_policy.h"

/* Solve for the moves of all stages by sweeps, from those that the last step predicts. The change by a sweep is looked at from
   that sweep on that was the last one in the step before, or from the one before it. */
static phi_status phi_collocate(phi_solver *s, double point[PHI_POINT], phi_lanes *moves)
{
    phi_history *past = &s->history;
    phi_lanes z[PHI_UNKNOWNS], next[PHI_UNKNOWNS], weights[1] = { { 0.0 } };
    double last = HUGE_VAL;
    int rising = 0, rises = 0;
    for (int i = 0; i < PHI_NODES; ++i) weights[0][i] = s->h * phi_weights[i];
    if (past->count > 0) {
        phi_seen(s, next);
        phi_mixed(phi_prediction, next, z);
    } else {
        PHI_CLEAR_STAGES(z);
        past->rate = 0.5;
        past->sweeps = 2;
    }
    phi_slopes(s, point, weights, z, moves);
    const double square = phi_square(s->x, moves);
    for (int sweep = 2; sweep <= PHI_MAX_SWEEPS; ++sweep) {
        phi_mixed(phi_mixing, moves, z);
        ++s->evaluations;
        if (sweep < past->sweeps) {
            phi_slopes(s, point, weights, z, moves);
            continue;
        }
        phi_slopes(s, point, weights, z, next);
        const double change = phi_change_of(square, moves, next), rate = change / last;
        PHI_COPY_STAGES(moves, next, next);
        if (!isfinite(change)) return PHI_NOT_FINITE;
        if (rate > 0.0 && rate < 1.0 && change > PHI_NEARLY_ROUNDING) past->rate = 0.7 * past->rate + 0.3 * rate;
        const int solved = change * past->rate <= PHI_SOLVED;
        const int slow = rate >= 1.0 || rate > fmax(PHI_STALLED, 1.5 * past->rate);
        if (rate >= 1.0 && change <= PHI_NEARLY_ROUNDING) ++rises;
        if (solved || (slow && change <= PHI_ROUNDING) || rises > 1) {
            if (sweep == past->sweeps || rate > 2.0 * past->rate) --past->sweeps; /* the first change was rounding too */
            else past->sweeps = sweep - 1;
            if (past->sweeps < 2) past->sweeps = 2;
            return PHI_OK;
        }
        rising = rate >= 1.0 ? rising + 1 : 0; /* transients may rise over as many sweeps as there are stages */
        if (rising >= (int)PHI_NODES + PHI_MOST_RISING) return PHI_NO_CONVERGENCE;
        last = change;
    }
    return PHI_NO_CONVERGENCE;
}

#if PHI_MONITOR
/* The time that a step takes: the integral of dt/dtau by the values at its stages. */
static double phi_time_of(const phi_solver *s, double point[PHI_POINT], phi_lanes *moves)
{
    double sum = 0.0;
    phi_lanes z[PHI_UNKNOWNS], weights[1] = { { 0.0 } };
    for (int i = 0; i < PHI_NODES; ++i) weights[0][i] = s->h * phi_weights[i];
    phi_mixed(phi_mixing, moves, z);
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
/* One step. If it fails, the state is as before. */
static phi_status phi_attempt(phi_solver *s)
{
    double point[PHI_POINT], end[PHI_UNKNOWNS], change[PHI_DIM];
    phi_lanes moves[PHI_UNKNOWNS];
    phi_history *past = &s->history;
    phi_start(s, point);
    const phi_status status = phi_collocate(s, point, moves);
    if (status != PHI_OK) return status;
    phi_end(moves, end);
    phi_stage_change(s->coef, point, end, change);
#if PHI_MONITOR
    const double elapsed = phi_time_of(s, point, moves);
    if (!(elapsed * s->h > 0.0)) return PHI_NOT_FINITE;
#endif
    if (!phi_advance(s, change, s->carry)) return PHI_NOT_FINITE;
    PHI_PASS(s, elapsed)
    PHI_COPY_STAGES(past->moves, moves, moves);
    past->count = 1;
    return PHI_OK;
}
#endif
