#ifndef PHI_FILE_SOLVER
#define PHI_FILE_SOLVER
#include <math.h>
#include <string.h>

#include "solver.h"
#include "start_policy.h"
#include "steps.c"
#include "attitude.c"
#include "level.c"
#include "gauge.c"
#include "noise.c"

PHI_CHAPTER_OF_SOLVER
#include "gauge_formula.c"

/* Initialise *s at the state x0. The arguments may be parts of *s, which is therefore written last. */
phi_status PHI_INIT_FROM(phi_solver *s, const phi_params *params, const double x0[PHI_DIM] PHI_AND_START)
{
    if (s == NULL || x0 == NULL PHI_OR_NO_T0) return PHI_BAD_ARGUMENT;
    PHI_DEFAULT_PARAMETERS
    phi_solver fresh;
    PHI_EMPTY(fresh)
    fresh.h = (double)NAN;
    fresh.params = *params;
    PHI_COPY(fresh.x, x0, fresh.x, PHI_DIM);
    PHI_BEGIN_AT_T0(fresh)
    PHI_TRY_PARAMETERS(fresh)
    if (!phi_finite(fresh.x, PHI_DIM) PHI_OR_BAD_PARAMETERS(fresh))
        return PHI_BAD_ARGUMENT;
    PHI_CHOOSE_GAUGE(fresh)
    PHI_TAKE_GAUGE(fresh)
    PHI_ASK_FOR_GAUGE(fresh)
    PHI_TAKE_RATE_OF_TIME(fresh)
    phi_begin_unturned(&fresh);
    *s = fresh;
    return PHI_OK;
}

#include "start.c"
#include "renewed_stages.c"
#include "renewed_flows.c"
#include "renewed_noise.c"
#include "stage_predicted.c"
#include "device_stage.c"
#include "stage_alone.c"
#include "stages.c"

PHI_ABOUT_RUN
PHI_RUN(phi_solver *s, double h, size_t steps PHI_AND_RECORD)
{
    if (s == NULL || !isfinite(h)) return PHI_BAD_ARGUMENT;
    if (h != s->h) { /* a new step size needs new coefficients */
        PHI_EACH_STAGE
            phi_prepare(&s->params PHI_AND_GAUGE(s->gauge), PHI_FRACTION(h), PHI_OF(s->coef, stage));
#include "state_reset.h"
    }
    PHI_BEFORE_RUN
    PHI_CORRECT_START
    for (; steps > 0; --steps) {
        PHI_DRAW
        PHI_NEXT_DRAW
        phi_renew(s);
        PHI_NAME_INCREMENT
        PHI_COMPUTE_INCREMENT(s)
        PHI_COUNT_EVALUATION(s)
        PHI_MAKE_STEP(s)
        PHI_NEXT_RECORD
        PHI_END_IF_STEP_FAILED(s)
        ++s->steps;
        PHI_COUNT_TIME(s)
    }
    return PHI_END_RUN(PHI_OK);
}

#include "step_of_run.c"
#include "placing.c"
#include "parameters.c"
#include "interpolate.c"

#include "status.c"

#include "sizes.c"
#endif
