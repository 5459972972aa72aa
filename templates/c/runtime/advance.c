#ifndef PHI_FILE_ADVANCE
#define PHI_FILE_ADVANCE
#include <math.h>
#include <string.h>

#include "model.h"

/* Add `change` + `rest` to s->x by compensated summation. `rest` holds the compensation term, and other terms that are
   small compared with `change`. Returns 0, with s->x unchanged, if the sum is not finite. */
static int phi_advance(phi_solver *s, const double *change, const double *rest)
{
    double x[PHI_DIM], carry[PHI_DIM];
    for (int i = 0; i < PHI_DIM; ++i) {
        const double sum = s->x[i] + change[i], added = sum - s->x[i];
        const double lost = ((s->x[i] - (sum - added)) + (change[i] - added)) + rest[i];
        x[i] = sum + lost;
        carry[i] = lost - (x[i] - sum);
        if (!isfinite(x[i])) return 0;
    }
    PHI_COPY(s->x, x, x, PHI_DIM);
    PHI_COPY(s->carry, carry, carry, PHI_DIM);
    return 1;
}
#endif
