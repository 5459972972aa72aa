#ifndef PHI_FILE_NOISE_OF_FLOWS
#define PHI_FILE_NOISE_OF_FLOWS
#include "solver.h"

/* If h < 0, exchange the increments of the first and the second half of the step, so that the step inverts a step of
   size -h. */
static void phi_order_draws(phi_solver *s)
{
    for (int k = 0; k < PHI_SOURCES && s->h < 0.0; ++k) {
        const double late = s->dw[PHI_SOURCES + k];
        s->dw[PHI_SOURCES + k] = s->dw[k];
        s->dw[k] = late;
    }
}
#endif
