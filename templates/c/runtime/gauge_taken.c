#ifndef PHI_FILE_GAUGE_TAKEN
#define PHI_FILE_GAUGE_TAKEN
#include <string.h>

#include "algebra.c"
#include "gauge.c"
#include "gauge_formula.c"
#include "level.c"

/* Hold the given gauge fixed, or for NULL the one chosen at the state. 0 if it is not finite. */
static int phi_take_gauge(phi_solver *s, const double gauge[PHI_GAUGES])
{
    if (gauge == NULL) phi_choose_gauge(&s->params, s->x, s->gauge);
    else PHI_COPY(s->gauge, gauge, s->gauge, PHI_GAUGES);
    return phi_finite(s->gauge, PHI_GAUGES);
}
#endif
