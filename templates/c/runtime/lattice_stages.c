#ifndef PHI_FILE_LATTICE_STAGES
#define PHI_FILE_LATTICE_STAGES
#include <math.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "sweeps.h"
#include "lattice_back.c"

/* ---- The stages ---- */
#include "lattice_sweep_policy.h"
enum { PHI_WIDTH = 32 }; /* number of partial results in a reduction over sites; with a single result, the loop would not vectorise */

static inline void phi_raise(double *largest, double value) { *largest = value > *largest ? value : *largest; }

/* For each field, raise `change` to the largest change of y by a sweep, and `size` to the largest |y|, at the sites of a row
   segment. NaN is left out. */
static void phi_measure(const phi_solver *s, int now, size_t unit, double *change, double *size)
{
    const phi_row row = phi_piece_of(s, unit);
    const ptrdiff_t vectors_end = row.to - (row.to - row.from) % PHI_WIDTH;
    for (int k = 0; k < PHI_DIM; ++k) {
        const double *restrict before = PHI_HERE(s->y[now][k]), *restrict after = PHI_HERE(s->y[1 - now][k]);
        double changes[PHI_WIDTH] = { 0.0 }, sizes[PHI_WIDTH] = { 0.0 };
        for (ptrdiff_t i = row.from; i < vectors_end; i += PHI_WIDTH)
            for (int l = 0; l < PHI_WIDTH; ++l) {
                phi_raise(changes + l, fabs(after[i + l] - before[i + l]));
                phi_raise(sizes + l, fabs(after[i + l]));
            }
        for (ptrdiff_t i = vectors_end; i < row.to; ++i) {
            phi_raise(changes, fabs(after[i] - before[i]));
            phi_raise(sizes, fabs(after[i]));
        }
        for (int l = 1; l < PHI_WIDTH; ++l) {
            phi_raise(changes, changes[l]);
            phi_raise(sizes, sizes[l]);
        }
        PHI_ONE_BY_ONE
        {
            phi_raise(change + k, *changes);
            phi_raise(size + k, *sizes);
        }
    }
}

#if PHI_ADJOINT
/* Compute `to` = `from` (0 if NULL) + (transpose of the derivative of a kernel at y = s->y[2]) v, at all sites. */
static void phi_pull(const phi_solver *s, int kernel, const double *coef, double *const *v, double *const *from, double *const *to)
{
    PHI_PARALLEL
    {
        size_t first, end = phi_share(phi_units(s), &first);
        phi_pull_rows(s, kernel, coef, v, from, to, first, end);
    }
}

/* Make a fixed-point sweep from s->y[now] to s->y[1 - now]; with coef = NULL, only compare the two. Returns the largest
   change of a field relative to its size; the result is not finite if y is not. In a reverse pass s->side is not NULL;
   y is then a cotangent, and the sweep is side + (transposed derivative of a sweep at s->y[2]) y. */
#else
/* Make a fixed-point sweep from s->y[now] to s->y[1 - now]; with coef = NULL, only compare the two. Returns the largest
   change of a field relative to its size, not finite if y is not. */
#endif
static double phi_relaxed(phi_solver *s, const double *coef PHI_AND_INT_FULL_RANGE, int now)
{
    const size_t units = phi_units(s);
    double change[PHI_DIM] = { 0.0 }, size[PHI_DIM] = { 0.0 }, largest = 0.0, largest_change = 0.0;
#if PHI_ADJOINT
    if (coef != NULL && s->side != NULL) {
        phi_pull(s, PHI_SLOPE_BACK, coef, s->y[now], s->side, s->y[1 - now]);
        coef = NULL;
    }
#endif
    PHI_EACH_PIECE
    for (size_t unit = 0; unit < units; ++unit) {
        if (coef != NULL) phi_stage_piece(s, coef PHI_AND_FULL_RANGE(full_range), s->y[now], s->y[1 - now], unit);
        phi_measure(s, now, unit, change, size);
    }
    for (int k = 0; k < PHI_DIM; ++k) phi_raise(&largest, size[k]);
    for (int k = 0; k < PHI_DIM; ++k) {
        s->usual[k] = size[k] + PHI_LEAST_SIZE * largest + 1e-300;
        change[k] /= s->usual[k]; /* NaN if both are infinite */
        largest_change = isnan(change[k]) || change[k] > largest_change ? change[k] : largest_change;
    }
    return largest_change;
}

#include "lattice_without_predictors.c"
#include "lattice_predictors.c"

#include "lattice_newton.c"

/* Write the solution y of a stage to the tape, and also x if the reverse pass reads it; returns the new end of the tape. */
static double *phi_store_stage(const phi_solver *s, int now, double *to)
{
    const size_t block = phi_block(s->rows, s->width), units = phi_units(s);
#if PHI_STARTS
    double *const *const fields[] = { s->y[now], s->x };
#else
    double *const *const fields[] = { s->y[now] };
#endif
    PHI_EACH_PIECE
    for (size_t unit = 0; unit < units; ++unit)
        for (size_t k = 0; k < PHI_STORED_STATES * PHI_DIM; ++k)
            phi_store_units(s, PHI_MEMORY_OF(fields[k / PHI_DIM][k % PHI_DIM]), to + k * block, unit, unit + 1);
    return to + PHI_STORED_STATES * PHI_DIM * block;
}

/* Make all stages of a step: solve for y, and add the increment to x. */
static phi_status phi_stages(phi_solver *s PHI_AND_INT_FULL_RANGE)
{
    const size_t units = phi_units(s);
#if PHI_ADJOINT
    double *tape = s->tape;
#endif
#if PHI_NOISE
    PHI_EACH_PIECE
    for (size_t unit = 0; unit < units; ++unit) phi_draw_pieces(s, s->steps, 0, unit, unit + 1);
#endif
    PHI_EACH_STAGE {
#if PHI_RENEWED
        double *coef = PHI_ROW_OF(s->coef, stage);
#else
        const double *coef = PHI_ROW_OF(s->coef, stage);
#endif
#if PHI_TIMED
        s->now = s->t + PHI_OF(phi_middles, stage) * s->h;
#endif
#if PHI_RENEWED
        phi_refresh(coef, s->now, coef + PHI_PREPARED);
#endif
        int now = 0;
        phi_predict(s, s->x PHI_AND_PREDICTOR);
        phi_status status = s->stiff ? PHI_NO_CONVERGENCE : phi_middle(s, coef PHI_AND_FULL_RANGE(full_range), 0.0, &now);
#if PHI_NEAR
        if (status != PHI_OK && (full_range || status != PHI_NOT_FINITE)) {
#else
        if (status != PHI_OK) {
#endif
            s->stiff = 1;
            now = 0;
            const double range = phi_range(s, coef);
            phi_predict(s, s->x PHI_AND_PREDICTOR);
            status = phi_middle(s, coef PHI_AND_FULL_RANGE(full_range), range, &now);
        }
#if PHI_TANGENT
        for (size_t k = 0; k < s->vectors && status == PHI_OK; ++k) status = phi_vary(s, coef, now, k);
#endif
        if (status != PHI_OK) return status;
#if PHI_ADJOINT
        if (tape != NULL) tape = phi_store_stage(s, now, tape);
#endif
#if PHI_SWEEP_PREDICTORS
        phi_remember(s, s->x PHI_AND_STAGE, now);
#endif
        PHI_EACH_PIECE
        for (size_t unit = 0; unit < units; ++unit) phi_stage_piece(s, coef PHI_AND_FULL_RANGE(full_range), s->y[now], s->x, unit);
    }
    return phi_all_hold(s, s->x) ? PHI_OK : PHI_NOT_FINITE;
}

/* Make one step, or leave the state unchanged. */
static phi_status phi_try(phi_solver *s)
{
    phi_copy(s->before, s->x, s);
#if PHI_NEAR
    if (phi_stages(s, 0) == PHI_OK) return PHI_OK;
    phi_copy(s->x, s->before, s);
    phi_forget(s);
#endif
    const phi_status status = phi_stages(s PHI_AND_FULL_RANGE(1));
    if (status == PHI_OK) return status;
    phi_copy(s->x, s->before, s);
    phi_forget(s);
    return status;
}

phi_status phi_integrate(phi_solver *s, double h, size_t steps)
{
    phi_status status = phi_set_step(s, h);
    if (status != PHI_OK) return status;
    phi_forget(s);
    for (; steps > 0 && status == PHI_OK; --steps) {
        status = phi_try(s);
        s->steps += status == PHI_OK;
        s->t = PHI_TIME_AFTER(s, s->steps);
    }
#if PHI_TIMED
    s->now = s->t;
#endif
    return status;
}

#endif
