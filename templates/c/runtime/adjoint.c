#ifndef PHI_FILE_ADJOINT
#define PHI_FILE_ADJOINT
#include <math.h>
#include <string.h>

#include "adjoint_stage.c"
#include "adjoint_gauss.c"
#include "algebra.c"
#include "model.h"
#include "solver.c"
#include "adjoint_lanes.c"

/* Set *s back to the time before the last step: the number of steps, the time and the coefficients, but not the state.
   */
static void phi_rewind(phi_solver *s)
{
    --s->steps;
    PHI_COUNT_TIME(s)
    phi_renew(s);
}

/* If the state after `done` steps is an output row, add the derivatives of L by this row to the cotangent of the state.
   */
static void phi_join(phi_cotangent *bar, const double *rows_bar, size_t done, size_t steps, size_t stride)
{
    if (done != steps && done % stride != 0) return;
    const double *row = rows_bar + (done + stride - 1) / stride * PHI_DIM - PHI_DIM;
    for (int i = 0; i < PHI_DIM; ++i) bar->x[i] += row[i];
}

#include "adjoint_back_lanes.c"
#include "adjoint_back.c"
#include "adjoint_tape_implicit.c"
#include "adjoint_tape_flows.c"
#include "adjoint_tape_gauss.c"
#include "adjoint_tape_explicit.c"

/* Make steps and write their tape, the data for the reverse pass. `rows`, if not NULL, receives the states after
   stride, 2 * stride, ... steps and at the end. */
static phi_status phi_record_run(phi_solver *s, size_t steps, size_t stride, double *rows,
    phi_step_tape *tape)
{
    phi_status status = PHI_OK;
    for (size_t done = 0; done < steps && status == PHI_OK;) {
        const size_t until = steps - done < stride - done % stride ? steps - done : stride - done % stride;
        const size_t count = until < PHI_AT_ONCE ? until : PHI_AT_ONCE;
        status = phi_record_steps(s, count, tape + done);
        done += count;
        if (rows != NULL && count == until) {
            memcpy(rows, s->x, sizeof s->x);
            rows += PHI_DIM;
        }
    }
    return status;
}

#include "adjoint_parameters_flows.c"
#include "adjoint_parameters_stages.c"
#include "adjoint_level.c"

phi_status phi_pullback(phi_solver *s, double h, size_t steps, size_t stride, double *rows, const double *rows_bar,
    double x0_bar[PHI_DIM], phi_params *params_bar PHI_AND_DOUBLE(e_bar), double *trail)
{
    if (s == NULL || rows_bar == NULL || x0_bar == NULL || trail == NULL || stride == 0) return PHI_BAD_ARGUMENT;
    const phi_solver before = *s;
    phi_status status = phi_integrate(s, h, 0); /* 0 steps: computes all coefficients for h */
    if (status != PHI_OK) return status;
    phi_step_tape *tape = (phi_step_tape *)trail;
    phi_cotangent bar;
    memset(&bar, 0, sizeof bar);
    status = phi_record_run(s, steps, stride, rows, tape);
    if (status == PHI_OK) {
        phi_solver at = *s;
        PHI_BEGIN_PATHS_BACK(bar, s)
        status = phi_back(&at, steps, stride, rows_bar, tape, &bar);
    }
    for (int i = 0; i < PHI_DIM; ++i)
        if (!isfinite(bar.x[i]) && status == PHI_OK) status = PHI_NOT_FINITE;
    if (status != PHI_OK) {
        *s = before;
        return status;
    }
    phi_add_by_parameters(s, &bar, params_bar PHI_AND_E_BAR);
    PHI_NO_PARAMETERS(params_bar)
    memcpy(x0_bar, bar.x, sizeof bar.x);
    return PHI_OK;
}

size_t phi_trail_size(void) { return PHI_TRAIL; }

phi_status phi_step_adjoint(phi_solver *s, double h, const double x1_bar[PHI_DIM], double x0_bar[PHI_DIM],
    phi_params *params_bar)
{
    double trail[PHI_TRAIL];
    return phi_pullback(s, h, 1, 1, NULL, x1_bar, x0_bar, params_bar PHI_AND_NO_LEVEL, trail);
}
#endif
