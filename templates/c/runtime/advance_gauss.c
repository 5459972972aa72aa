#ifndef PHI_FILE_ADVANCE_GAUSS
#define PHI_FILE_ADVANCE_GAUSS
#include "model.h"

/* Add `change` + `rest` to s->x by compensated summation. `rest` holds the compensation term, and other terms that are
   small compared with `change`. Returns 0, with s->x unchanged, if the sum is not finite. */
static inline int phi_advance(phi_solver *s, const double *change, const double *rest)
{
    double x[PHI_DIM], carry[PHI_DIM], zero = 0.0; /* x - x is 0 if x is finite, else NaN */
    for (int i = 0; i < PHI_DIM; ++i) { /* the next step needs x only, so x is computed by two additions and does not wait for the carry */
        const double total = change[i] + rest[i], more = total - change[i];
        const double sum = s->x[i] + total, added = sum - s->x[i];
        x[i] = sum;
        zero += sum - sum;
        carry[i] = ((s->x[i] - (sum - added)) + (total - added)) + ((change[i] - (total - more)) + (rest[i] - more));
    }
    if (!(zero == 0.0)) return 0;
    /* Copy one number at a time: a load of several would wait until all of them have been stored. */
    for (int i = 0; i < PHI_DIM; ++i) s->x[i] = x[i];
    for (int i = 0; i < PHI_DIM; ++i) s->carry[i] = carry[i];
    return 1;
}
#endif
