#ifndef PHI_FILE_LATTICE_ADJOINT_STAGES
#define PHI_FILE_LATTICE_ADJOINT_STAGES
#include <math.h>
#include <string.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "lattice_checkpoints.c"

/* ---- Reverse pass of stages ---- */
/* A stage solves y = r(x, y) and adds a(y) to x. With v the cotangent of x after the stage, the cotangent m of y solves
   m = (dr/dy)^T m + (da/dy)^T v, and the cotangent of x before the stage is v + (dr/dx)^T m. The code that solves for y
   also solves for m. */

/* Add the cotangent of an output row, a state of the run, to the cotangent of the state. */
static void phi_row_back(const phi_solver *s, phi_transpose *g, size_t steps, const double *row_bar)
{
    for (size_t f = 0; f < PHI_DIM; ++f) {
        phi_put(s, g->row_bar[f], row_bar + f * s->sites);
        for (size_t i = 0; i < g->block; ++i) (PHI_MEMORY_OF(g->bar[f]))[i] += (PHI_MEMORY_OF(g->row_bar[f]))[i];
    }
    (void)steps;
}

/* Pull cotangents back through a stage, from its solution on the tape. */
static phi_status phi_stage_back(phi_solver *s, phi_transpose *g, double *tape PHI_AND_INT_STAGE)
{
    const double *coef = PHI_ROW_OF(s->coef, stage);
    double *side[PHI_BARS], *m[PHI_BARS];
    memcpy(side, g->bar, sizeof side);
    memcpy(side, g->row_bar, sizeof *side * PHI_DIM);
    for (size_t f = 0; f < PHI_DIM; ++f) {
        s->y[2][f] = PHI_FIRST_SITE(tape + f * g->block);
#if PHI_STARTS
        s->x[f] = s->y[2][f] + PHI_DIM * g->block;
#endif
        memset(PHI_MEMORY_OF(side[f]), 0, g->block * sizeof **side);
    }
    phi_pull(s, PHI_ADVANCE_BACK, coef, g->bar, side, side);
    int now = 0;
    s->side = side;
    phi_predict(s, side PHI_AND_PREDICTOR);
    phi_status status = s->stiff ? PHI_NO_CONVERGENCE : phi_middle(s, coef PHI_AND_FULL_RANGE(1), 0.0, &now);
    if (status != PHI_OK) {
        s->stiff = 1;
        now = 0;
        phi_predict(s, side PHI_AND_PREDICTOR);
        status = phi_middle(s, coef PHI_AND_FULL_RANGE(1), HUGE_VAL, &now);
    }
    s->side = NULL;
    if (status != PHI_OK) return PHI_SINGULAR;
#if PHI_SWEEP_PREDICTORS
    phi_remember(s, side PHI_AND_STAGE, now);
#endif
    memcpy(m, s->y[now], sizeof *m * PHI_DIM);
    phi_pull(s, PHI_RELAX_BACK, coef, m, g->bar, g->bar);
    return PHI_OK;
}

/* Pull cotangents back through one step, from the solutions of its stages on the tape. */
static phi_status phi_step_back(phi_solver *s, phi_transpose *g, size_t steps, double *tape)
{
    double *x[PHI_DIM], *left = tape + g->of_step;
    phi_status status = PHI_OK;
    memcpy(x, s->x, sizeof x);
    PHI_EACH_STAGE_BACK {
#if PHI_TIMED
        s->now = PHI_TIME_AFTER(s, steps) + PHI_OF(phi_middles, stage) * s->h;
#endif
#if PHI_RENEWED
        phi_refresh(PHI_ROW_OF(s->coef, stage), s->now, PHI_ROW_OF(s->coef, stage) + PHI_PREPARED);
#endif
        left -= PHI_STORED_STATES * PHI_DIM * g->block;
        if (status == PHI_OK) status = phi_stage_back(s, g, left PHI_AND_STAGE);
    }
    memcpy(s->x, x, sizeof x);
    (void)steps;
    return status;
}

/* Make the steps from number `done` to number `until` of a run. `rows`, if not NULL, receives the states after stride,
   2 stride, ... steps and at the end of the run; predictors restart after each of these states. keeping = 1 writes the
   tape. */
static phi_status phi_walk(phi_solver *s, phi_transpose *g, size_t done, size_t until, size_t stride, size_t steps,
    double *rows, int keeping)
{
    phi_status status = PHI_OK;
    double *tape = g->tape;
    for (; done < until && status == PHI_OK; tape += g->of_step) {
        if (rows != NULL && done % stride == 0) phi_forget(s);
        s->tape = keeping ? tape : NULL;
        status = phi_try(s);
        if (status != PHI_OK) break;
        phi_stand(s, s->steps + 1);
        ++done;
        if (phi_is_stopped(s, g, 1)) status = PHI_STOPPED;
        if (rows != NULL && (done == steps || done % stride == 0))
            phi_take(s, s->x, rows + (done - 1) / stride * PHI_DIM * s->sites);
    }
    s->tape = NULL;
    return status;
}

/* Set the solver to the state after all steps or, on failure, to the state before them; returns the status. */
static phi_status phi_settle(phi_solver *s, phi_transpose *g, size_t steps, phi_status status)
{
    if (status == PHI_OK && steps > 0) {
        phi_copy(s->x, g->end, s);
        phi_stand(s, g->first_step + steps);
    } else {
        g->count = 1;
        phi_return(s, g);
    }
    return status;
}
#endif
