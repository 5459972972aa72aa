#ifndef PHI_FILE_LATTICE_PREDICTORS
#define PHI_FILE_LATTICE_PREDICTORS
#include "lattice.h"
#include "model.h"

/* Predict the solution of a stage, with the halo: x plus a change that is extrapolated from earlier steps. */
static void phi_predict(const phi_solver *s, double *const *x PHI_AND_INT_STAGE)
{
    PHI_EACH_PIECE
    for (size_t row = 0; row < s->rows; ++row)
        for (int k = 0; k < PHI_DIM; ++k) {
            const ptrdiff_t first = PHI_FIRST_COPY((ptrdiff_t)row * s->width), end = first + PHI_WITH_COPIES(s->length);
            for (ptrdiff_t i = first; i < end; ++i) s->y[0][k][i] = x[k][i];
            for (int d = 0; d < PHI_OF(s->predictor, stage).order; ++d) {
                const double *difference = PHI_OF(s->predictor, stage).difference[d][k];
                for (ptrdiff_t i = first; i < end; ++i) s->y[0][k][i] += difference[i];
            }
        }
}

/* Update the predictor with the solution y of a stage that began at `from`. The error of the prediction of order d is the d-th difference;
   the order with the smallest error is used next. */
static void phi_remember(phi_solver *s, double *const *from PHI_AND_INT_STAGE, int now)
{
    phi_predictor *predictor = &PHI_OF(s->predictor, stage);
    double size[PHI_DIFFERENCES] = { 0.0 }, least = HUGE_VAL;
    PHI_EACH_PIECE
    for (size_t row = 0; row < s->rows; ++row) {
        double largest[PHI_DIFFERENCES] = { 0.0 };
        for (int k = 0; k < PHI_DIM; ++k) {
            const ptrdiff_t first = PHI_FIRST_COPY((ptrdiff_t)row * s->width), end = first + PHI_WITH_COPIES(s->length);
            const double *restrict y = s->y[now][k], *restrict x = from[k];
            for (ptrdiff_t i = first; i < end; ++i) {
                double next = y[i] - x[i];
                for (int d = 0; d < predictor->count; ++d) {
                    const double last = predictor->difference[d][k][i];
                    predictor->difference[d][k][i] = next;
                    next -= last;
                    phi_raise(largest + d, fabs(next));
                }
                if (predictor->count < PHI_DIFFERENCES) predictor->difference[predictor->count][k][i] = next;
            }
        }
        PHI_ONE_BY_ONE
        for (int d = 0; d < PHI_DIFFERENCES; ++d) phi_raise(size + d, largest[d]);
    }
    predictor->order = 1;
    for (int d = 0; d < predictor->count; ++d)
        if (size[d] < least) {
            least = size[d];
            predictor->order = d + 1;
        }
    if (predictor->count < PHI_DIFFERENCES) ++predictor->count;
}

/* Clear the predictors; the next stage is solved by fixed-point sweeps, without a prediction. */
static void phi_forget(phi_solver *s)
{
    s->stiff = 0;
#if PHI_BANDED
    s->factored = NULL;
#endif
    PHI_EACH_STAGE PHI_OF(s->predictor, stage).count = PHI_OF(s->predictor, stage).order = 0;
}
#endif
