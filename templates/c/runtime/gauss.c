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
    memcpy(point, s->x, sizeof s->x);
#if PHI_TIMED
    point[PHI_DIM] = s->t;
#endif
}

/* h b_j times the vector field at all stages, where the unknowns are z. */
static void phi_slopes(const phi_solver *s, double point[PHI_POINT], phi_lanes *z, phi_lanes *moves)
{
#if PHI_STAGED
    phi_stage_field_lanes(s->coef, point, z, moves);
    for (int k = 0; k < PHI_UNKNOWNS; ++k) {
        double *move = moves[k];
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_WIDTH; ++lane) move[lane] *= s->h * phi_weights[lane];
    }
#else
    double at[PHI_UNKNOWNS], slope[PHI_UNKNOWNS];
    for (int i = 0; i < PHI_NODES; ++i) {
        for (int k = 0; k < PHI_UNKNOWNS; ++k) at[k] = z[k][i];
        phi_stage_field(s->coef, point, at, slope);
        for (int k = 0; k < PHI_UNKNOWNS; ++k) moves[k][i] = s->h * phi_weights[i] * slope[k];
    }
#endif
}

/* The largest change at any stage, in sizes of the unknowns: of coordinates the norm of x, of group elements 1. */
static double phi_change_of(const double x[PHI_DIM], phi_lanes *before, phi_lanes *after)
{
    double norm = DBL_MIN, largest = 0.0;
    phi_lanes sum = { 0.0 };
    for (int i = 0; i < PHI_DIM; ++i) norm += x[i] * x[i];
    if (norm <= DBL_MIN)
        for (int k = 0; k < PHI_PLAIN; ++k)
            for (int i = 0; i < PHI_NODES; ++i) norm += after[k][i] * after[k][i];
    for (int k = 0; k < PHI_UNKNOWNS; ++k) {
        const double *old = before[k], *now = after[k], scale = k < PHI_PLAIN ? 1.0 / norm : 1.0;
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_WIDTH; ++lane) sum[lane] += (now[lane] - old[lane]) * (now[lane] - old[lane]) * scale;
    }
    for (int i = 0; i < PHI_NODES; ++i)
        if (!(sum[i] <= largest)) largest = sum[i]; /* or not a number */
    return sqrt(largest);
}

enum {
    PHI_STALLS = 2,      /* changes in the size of rounding that are not less than those before: no more is to be gained */
    PHI_MOST_RISING = 3, /* sweeps one after the other that change more than those before: the step is too large */
    PHI_PROBE = 16       /* every so many steps it is tried whether one sweep less will do */
};
#define PHI_SOLVED 2e-18   /* what a next sweep may change; 2e-17 leaves a linear drift of energy and Casimirs */
#define PHI_ROUNDING 2e-14 /* changes below this that do not shrink are rounding */

/* Solve for the moves of all stages by sweeps, from those that the last step predicts. Changes are looked at only from that
   sweep on that was the last one in the step before. */
static phi_status phi_collocate(phi_solver *s, double point[PHI_POINT], phi_lanes *moves)
{
    phi_history *past = &s->history;
    phi_lanes z[PHI_UNKNOWNS], next[PHI_UNKNOWNS];
    double last = HUGE_VAL;
    int rising = 0, stalls = 0;
    if (past->count > 0) {
        phi_lanes known[PHI_UNKNOWNS];
        memcpy(known, past->moves, sizeof known);
        phi_mixed(phi_prediction, known, z);
    } else {
        memset(z, 0, sizeof z);
        past->rate = 0.5;
        past->sweeps = 2;
    }
    phi_slopes(s, point, z, moves);
    for (int sweep = 2; sweep <= PHI_MAX_SWEEPS; ++sweep) {
        phi_mixed(phi_mixing, moves, z);
        phi_slopes(s, point, z, next);
        ++s->evaluations;
        if (sweep < past->sweeps) {
            memcpy(moves, next, sizeof next);
            continue;
        }
        const double change = phi_change_of(s->x, moves, next), rate = change / last;
        memcpy(moves, next, sizeof next);
        if (!isfinite(change)) return PHI_NOT_FINITE;
        if (rate < 1.0 && last < HUGE_VAL && change > PHI_ROUNDING) past->rate = 0.7 * past->rate + 0.3 * rate;
        if (change * past->rate <= PHI_SOLVED || (change <= PHI_ROUNDING && change >= last && ++stalls == PHI_STALLS)) {
            past->sweeps = sweep > 2 && past->count % PHI_PROBE == 0 ? sweep - 1 : sweep;
            return PHI_OK;
        }
        rising = rate >= 1.0 ? rising + 1 : 0;
        if (rising >= PHI_MOST_RISING) return PHI_NO_CONVERGENCE;
        last = change;
    }
    return PHI_NO_CONVERGENCE;
}

/* One step. If it fails, the state is as before. */
static phi_status phi_attempt(phi_solver *s)
{
    double point[PHI_POINT], end[PHI_UNKNOWNS], change[PHI_DIM];
    phi_lanes moves[PHI_UNKNOWNS];
    phi_history *past = &s->history;
    phi_start(s, point);
    const phi_status status = phi_collocate(s, point, moves);
    if (status != PHI_OK) return status;
    for (int k = 0; k < PHI_UNKNOWNS; ++k) {
        end[k] = 0.0;
        for (int i = 0; i < PHI_NODES; ++i) end[k] += moves[k][i];
    }
    phi_stage_change(s->coef, point, end, change);
    if (!phi_advance(s, change, s->carry)) return PHI_NOT_FINITE;
#if PHI_FRAMED && PHI_STAGED
    phi_lanes seen[PHI_UNKNOWNS];
    phi_next_frame_lanes(s->coef, end, moves, seen);
    memcpy(past->moves, seen, sizeof seen);
#elif PHI_FRAMED
    double move[PHI_UNKNOWNS], seen[PHI_UNKNOWNS];
    for (int i = 0; i < PHI_NODES; ++i) {
        for (int k = 0; k < PHI_UNKNOWNS; ++k) move[k] = moves[k][i];
        phi_next_frame(s->coef, end, move, seen);
        for (int k = 0; k < PHI_UNKNOWNS; ++k) past->moves[k][i] = seen[k];
    }
#else
    memcpy(past->moves, moves, sizeof moves);
#endif
    past->count = past->count % PHI_PROBE + 1;
    return PHI_OK;
}
#endif
