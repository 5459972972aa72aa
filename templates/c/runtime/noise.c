#ifndef PHI_FILE_NOISE
#define PHI_FILE_NOISE
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "solver.h"

/* ---- Noise ---- */
/* Philox4x32-10 of J. Salmon, M. Moraes, R. Dror, D. Shaw, Parallel random numbers: as easy as 1, 2, 3 (2011): the
   counter becomes four random words. */
static void phi_philox(uint32_t counter[4], uint32_t key0, uint32_t key1)
{
    for (int round = 0; round < 10; ++round) {
        const uint64_t even = (uint64_t)0xD2511F53u * counter[0], odd = (uint64_t)0xCD9E8D57u * counter[2];
        const uint32_t low = counter[1], high = counter[3];
        counter[0] = (uint32_t)(odd >> 32) ^ low ^ key0;
        counter[1] = (uint32_t)odd;
        counter[2] = (uint32_t)(even >> 32) ^ high ^ key1;
        counter[3] = (uint32_t)even;
        key0 += 0x9E3779B9u;
        key1 += 0xBB67AE85u;
    }
}

/* 53 of the bits of two words, as a number from 0 up to, but not including, 2^53. */
static double phi_bits(uint32_t high, uint32_t low) { return (double)(high >> 5) * 67108864.0 + (double)(low >> 6); }

/* Independent normal variates of variance 1, in pairs by Box and Muller, cut off at PHI_BOUND. */
static void phi_normals(uint64_t seed, uint32_t member, uint64_t step, double normals[PHI_DRAWS])
{
    for (int k = 0; k < PHI_DRAWS; k += 2) {
        uint32_t c[4] = { (uint32_t)step, (uint32_t)(step >> 32), member, (uint32_t)(k / 2) };
        phi_philox(c, (uint32_t)seed, (uint32_t)(seed >> 32));
        const double radius = fmin(sqrt(-2.0 * log((phi_bits(c[0], c[1]) + 0.5) * 0x1p-53)), PHI_BOUND);
        const double angle = 6.283185307179586 * (phi_bits(c[2], c[3]) * 0x1p-53);
        normals[k] = radius * cos(angle);
        if (k + 1 < PHI_DRAWS) normals[k + 1] = radius * sin(angle);
    }
}

/* The increments of the next step: those given, or random ones. 0 if one is not finite. */
static int phi_draw(phi_solver *s, const double *given)
{
    if (given != NULL) {
        memmove(s->dw, given, sizeof s->dw);
    } else {
        phi_normals(s->seed, s->member, s->first_step + s->steps, s->dw);
        const double size = copysign(sqrt(fabs(s->h) / PHI_PARTS), s->h); /* so that a step of -h undoes one of h */
        for (int k = 0; k < PHI_DRAWS; ++k) s->dw[k] *= size;
#if PHI_SPLITTING
        for (int k = 0; k < PHI_SOURCES && s->h < 0.0; ++k) { /* what was last in the step of h comes first */
            const double late = s->dw[PHI_SOURCES + k];
            s->dw[PHI_SOURCES + k] = s->dw[k];
            s->dw[k] = late;
        }
#endif
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
#endif
