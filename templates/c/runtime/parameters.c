#ifndef PHI_FILE_PARAMETERS
#define PHI_FILE_PARAMETERS
#include <math.h>
#include <string.h>

#include "algebra.c"
#include "model.h"
#include "start_policy.h"
#include "attitude.c"
#include "level.c"

phi_status phi_set_parameters(phi_solver *s, const phi_params *params)
{
    if (s == NULL || params == NULL) return PHI_BAD_ARGUMENT;
    phi_solver changed = *s;
    changed.params = *params;
    changed.h = (double)NAN; /* so that the next step computes all coefficients */
#if PHI_MONITOR
    phi_choose_gauge(&changed.params, changed.x, changed.gauge);
#endif
#if PHI_RENEWED
    memset(changed.coef, 0, sizeof changed.coef); /* a failed step may have left values that are not finite */
#endif
    PHI_TRY_PARAMETERS(changed)
    if (!phi_finite(changed.x, PHI_DIM) PHI_OR_BAD_PARAMETERS(changed))
        return PHI_BAD_ARGUMENT;
#if PHI_MONITOR
    PHI_ASK_FOR_GAUGE(changed)
    PHI_TAKE_RATE_OF_TIME(changed)
#endif
#if PHI_GAUSS
    changed.history.kicked = 1;
#endif
    phi_renew_rate(&changed);
    *s = changed;
    return PHI_OK;
}
#endif
