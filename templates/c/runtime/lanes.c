#ifndef PHI_FILE_LANES
#define PHI_FILE_LANES
#include "model.h"

/* ---- SIMD lanes: one evaluation in each ---- */
/* The functions below evaluate the formulas of a step several times together, one evaluation in each lane. Compilers turn
   the loops over lanes into vector instructions. */
#if PHI_NARROW
enum { PHI_LANES = 4 }; /* a larger number would need too much stack for this system */
#else
enum { PHI_LANES = 8 }; /* numbers in one vector of AVX-512 */
#endif

#if defined(__GNUC__)
#if PHI_NARROW
typedef double phi_lanes[PHI_LANES] __attribute__((aligned(32))); /* one value in each lane */
#else
typedef double phi_lanes[PHI_LANES] __attribute__((aligned(64))); /* one value in each lane */
#endif
#else
typedef double phi_lanes[PHI_LANES];
#endif

/* This macro before a loop over lanes tells the compiler that the iterations are independent. */
#if defined(__clang__)
#if PHI_PACKS || PHI_STAGED
/* clang must not unroll loops over lanes, since it would then vectorise the loops around them instead. */
#define PHI_EACH_LANE _Pragma("clang loop vectorize(assume_safety) unroll(disable)")
#else
#define PHI_EACH_LANE _Pragma("clang loop vectorize(assume_safety)")
#endif
#pragma clang diagnostic push
#pragma clang diagnostic ignored "-Wpass-failed"
#elif defined(__GNUC__)
#define PHI_EACH_LANE _Pragma("GCC ivdep") _Pragma("GCC unroll 1")
#else
#define PHI_EACH_LANE
#endif

#if PHI_PACKS
/* Marks functions that are inlined, so that there is a copy for each value of a constant argument. */
#if defined(__GNUC__)
#define PHI_IN_PLACE __attribute__((always_inline))
#else
#define PHI_IN_PLACE
#endif

#endif
#include "lane_functions.c"
#endif
