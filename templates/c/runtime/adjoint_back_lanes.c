#ifndef PHI_FILE_ADJOINT_BACK_LANES
#define PHI_FILE_ADJOINT_BACK_LANES
#include <math.h>
#include <string.h>

#include "adjoint.c"

/* Pull the cotangent *bar back through the steps that led to *s, by their tape, and add the derivatives by output rows.
   Several stages are linearised at once, one in each lane. */
static phi_status phi_back(phi_solver *s, size_t steps, size_t stride, const double *rows_bar,
    phi_step_tape *tape, phi_cotangent *bar)
{
    phi_traced g;
    phi_lanes coef[PHI_COEFFICIENTS], slopes[PHI_COEFFICIENTS];
    phi_status status = PHI_OK;
    size_t at = steps; /* number of steps before the next stage to load */
    g.coef = coef;
    memset(g.after, 0, sizeof g.after);
    memset(g.change, 0, sizeof g.change);
    for (size_t left = PHI_ALL_STAGES(steps); left > 0 && status == PHI_OK;) {
        const int count = left < PHI_LANES ? (int)left : PHI_LANES;
        for (int lane = PHI_LANES - 1; lane >= 0; --lane) { /* unused lanes repeat the last stage */
            const size_t k = left - (size_t)count + (size_t)(lane < count ? lane : count - 1);
            PHI_TAKE_STAGE_OF(k)
            for (; at > PHI_STEP_OF(k); --at) phi_rewind(s);
            phi_load(&g, lane, s PHI_AND_STAGE, PHI_OF(tape[PHI_STEP_OF(k)], stage));
        }
        phi_linearise_back(&g);
        phi_solve_lanes(g.jacobian, g.gain, PHI_DIM, g.wrong); /* linearise now, before the cotangents are known */
        for (int lane = count - 1; lane >= 0 && status == PHI_OK; --lane) {
            const size_t k = left - (size_t)count + (size_t)lane;
            PHI_TAKE_STAGE_OF(k)
            PHI_IF_LAST_STAGE phi_join(bar, rows_bar, PHI_STEP_OF(k) + 1, steps, stride);
            status = phi_through(&g, lane, bar, PHI_OF(bar->coef, stage));
        }
        for (int lane = count; lane < PHI_LANES; ++lane) g.wrong[lane] = HUGE_VAL;
        phi_slopes_back(&g, slopes);
        for (int lane = 0; lane < count; ++lane)
            phi_gather(&g, slopes, lane, PHI_OF(bar->coef, (left - (size_t)count + (size_t)lane) % PHI_STAGES));
        left -= (size_t)count;
    }
    return status;
}
#endif
