#ifndef PHI_FILE_LATTICE_SHARES
#define PHI_FILE_LATTICE_SHARES
#include "lattice.h"
#include "model.h"

#if !PHI_SWEPT
/* Sums over sites consist of eight partial sums, one for each SIMD lane. Compilers must not unroll the loop over the eight,
   since they would vectorise the loop around it. Clang would keep the eight sums in memory, so it gets one sum in one loop
   over all sites, and may reorder its additions. */
#if defined(__clang__) && __clang_major__ >= 13
#define PHI_EACH_LANE _Pragma("clang loop vectorize(assume_safety) interleave_count(1)")
#define PHI_LANES(sites) (sites)
#define PHI_ADD(sums, l, value) { _Pragma("clang fp reassociate(on)") sums[0] += value; }
#else
#if defined(__clang__)
#define PHI_EACH_LANE _Pragma("clang loop vectorize(assume_safety) unroll(disable)")
#elif defined(__GNUC__)
#define PHI_EACH_LANE _Pragma("GCC ivdep") _Pragma("GCC unroll 1")
#else
#define PHI_EACH_LANE
#endif
#define PHI_LANES(sites) 8
#define PHI_ADD(sums, l, value) sums[l] += value;
#endif

#endif
/* Sum of the eight partial sums, which are overwritten. */
static inline double phi_total(double lanes[8])
{
    for (int l = 0; l < 4; ++l) lanes[l] += lanes[l + 4];
    return lanes[0] + lanes[2] + (lanes[1] + lanes[3]);
}

enum { PHI_ADDED = 64 }; /* number of sites whose contributions are stored before they are added */

/* Sum of the values. Eight partial sums let the loop vectorise. */
static inline double phi_added(const double *values, ptrdiff_t count)
{
    double lanes[8] = { 0.0 }, rest = 0.0;
    const ptrdiff_t vectors_end = count - count % 8;
    for (ptrdiff_t i = 0; i < vectors_end; i += 8)
        for (int l = 0; l < 8; ++l) lanes[l] += values[i + l];
    for (ptrdiff_t i = vectors_end; i < count; ++i) rest += values[i];
    return phi_total(lanes) + rest;
}
#endif
