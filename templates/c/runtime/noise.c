#ifndef PHI_FILE_NOISE
#define PHI_FILE_NOISE
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "solver.h"
#include "philox.c"

/* ---- Noise ---- */
/* Draw independent normal variates of mean 0 and variance 1: a function of seed, member and step. */
static void phi_normals(uint64_t seed, uint32_t member, uint64_t step, double normals[PHI_DRAWS])
{
    for (int k = 0; k < PHI_DRAWS; k += 2) {
        uint32_t counter[4] = { (uint32_t)step, (uint32_t)(step >> 32), member, (uint32_t)(k / 2) };
        double pair[2];
        phi_two_normals(seed, counter, pair);
        normals[k] = pair[0];
        if (k + 1 < PHI_DRAWS) normals[k + 1] = pair[1];
    }
}

#include "noise_of_flows.c"

/* Set the increments of the noise in the next step to `increments`, or to random numbers if `increments` is NULL.
   Returns 0 if an increment is not finite. */
static int phi_draw(phi_solver *s, const double *increments)
{
    if (increments != NULL) {
        PHI_TAKE_INCREMENTS(s->dw, increments);
    } else {
        phi_normals(s->seed, s->member, s->first_step + s->steps, s->dw);
        const double size = copysign(sqrt(fabs(s->h) / (double)PHI_PARTS), s->h); /* with the sign of h, so that a step of -h inverts a step of h */
        for (int k = 0; k < PHI_DRAWS; ++k) s->dw[k] *= size;
        phi_order_draws(s);
    }
    for (int k = 0; k < PHI_DRAWS; ++k)
        if (!isfinite(s->dw[k])) return 0;
    return 1;
}

phi_status phi_set_noise(phi_solver *s, uint64_t seed, uint32_t member, uint64_t step)
{
    if (s == NULL) return PHI_BAD_ARGUMENT;
    s->seed = seed;
    s->member = member;
    s->first_step = step - s->steps;
    return PHI_OK;
}

phi_status phi_integrate(phi_solver *s, double h, size_t steps) { return phi_integrate_along(s, h, steps, NULL); }
#endif
