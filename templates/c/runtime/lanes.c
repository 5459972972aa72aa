#ifndef PHI_FILE_LANES
#define PHI_FILE_LANES
#include "model.h"

/* ---- Several steps or members at once ---- */
/* Below, the formulas of a step are evaluated for several steps of a trajectory, or members of an ensemble, at once.
   Compilers make vector instructions of the loops over lanes. */
#if PHI_NARROW
enum { PHI_LANES = 4 }; /* more would need too much room on the stack */
#else
enum { PHI_LANES = 8 }; /* what one vector of AVX-512 holds */
#endif

#if defined(__GNUC__)
#if PHI_NARROW
typedef double phi_lanes[PHI_LANES] __attribute__((aligned(32))); /* a value in each lane */
#else
typedef double phi_lanes[PHI_LANES] __attribute__((aligned(64))); /* a value in each lane */
#endif
#else
typedef double phi_lanes[PHI_LANES];
#endif

/* Before a loop over lanes: tells compilers that they are independent. */
#if defined(__clang__)
#if PHI_PACKS
/* Loops over lanes that clang unrolls first make it look for vectors in the loops around them. */
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
/* Before a function that compilers put in the place of its calls, one for each value of a constant argument. */
#if defined(__GNUC__)
#define PHI_IN_PLACE __attribute__((always_inline))
#else
#define PHI_IN_PLACE
#endif

#endif
#include "lane_functions.c"
#endif
