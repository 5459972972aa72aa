#ifndef PHI_FILE_LARGEST
#define PHI_FILE_LARGEST
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "lanes.c"

/* Largest of the values in the lanes, which must not be negative; infinite if a value is not finite. The bits of positive
   numbers, read as integers, have the order of the numbers, and the bits of NaN are larger. */
static double phi_largest(const phi_lanes size)
{
    uint64_t bits[PHI_LANES], most = 0;
    double largest;
    memcpy(bits, size, sizeof bits);
    for (int lane = 0; lane < PHI_LANES; ++lane) most = bits[lane] > most ? bits[lane] : most;
    memcpy(&largest, &most, sizeof largest);
    return isfinite(largest) ? largest : HUGE_VAL;
}
#if PHI_BLOCKS

/* In each lane, replace `most` by the larger of `most` and `size`, where NaN counts as larger than all numbers. */
static void phi_update_largest(phi_lanes most, const phi_lanes size)
{
    uint64_t bits[PHI_LANES], bits_of_most[PHI_LANES];
    memcpy(bits, size, sizeof bits);
    memcpy(bits_of_most, most, sizeof bits);
    for (int lane = 0; lane < PHI_LANES; ++lane)
        bits_of_most[lane] = bits[lane] > bits_of_most[lane] ? bits[lane] : bits_of_most[lane];
    memcpy(most, bits_of_most, sizeof bits);
}
#endif
#endif
