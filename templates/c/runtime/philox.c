#ifndef PHI_FILE_PHILOX
#define PHI_FILE_PHILOX
#include <math.h>
#include <stdint.h>

#include "model.h"

/* ---- Random numbers ---- */
/* Replace a counter of four words by four random words: Philox4x32-10 of J. Salmon, M. Moraes, R. Dror, D. Shaw, Parallel
   random numbers: as easy as 1, 2, 3 (2011). */
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

/* A random integer from 0 to 2^53 - 1, from 53 bits of two words. */
static double phi_bits(uint32_t high, uint32_t low) { return (double)(high >> 5) * 67108864.0 + (double)(low >> 6); }

/* Two independent standard normal variates (Box and Muller), truncated at PHI_BOUND. */
static void phi_two_normals(uint64_t seed, uint32_t c[4], double normals[2])
{
    phi_philox(c, (uint32_t)seed, (uint32_t)(seed >> 32));
    const double radius = fmin(sqrt(-2.0 * log((phi_bits(c[0], c[1]) + 0.5) * 0x1p-53)), PHI_BOUND);
    const double angle = 6.283185307179586 * (phi_bits(c[2], c[3]) * 0x1p-53);
    normals[0] = radius * cos(angle);
    normals[1] = radius * sin(angle);
}
#endif
