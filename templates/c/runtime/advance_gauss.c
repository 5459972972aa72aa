#ifndef PHI_FILE_ADVANCE_GAUSS
#define PHI_FILE_ADVANCE_GAUSS
#include "model.h"

/* Add change + small to x in compensated arithmetic. small holds the compensation term and other small terms: rounded
   together with change, they would drift. Returns 0, with x unchanged, if the sum is not finite. */
static inline int phi_advance(phi_solver *s, const double *change, const double *small)
{
    double x[PHI_DIM], carry[PHI_DIM], zero = 0.0; /* a number less itself is 0, if it is finite */
    for (int i = 0; i < PHI_DIM; ++i) { /* x is available after two additions; the others are off the critical path */
        const double total = change[i] + small[i], more = total - change[i];
        const double sum = s->x[i] + total, added = sum - s->x[i];
        x[i] = sum;
        zero += sum - sum;
        carry[i] = ((s->x[i] - (sum - added)) + (total - added)) + ((change[i] - (total - more)) + (small[i] - more));
    }
    if (!(zero == 0.0)) return 0;
    /* One by one, as they are read next: a load of several numbers would wait until all have been stored. */
    for (int i = 0; i < PHI_DIM; ++i) s->x[i] = x[i];
    for (int i = 0; i < PHI_DIM; ++i) s->carry[i] = carry[i];
    return 1;
}
#endif
