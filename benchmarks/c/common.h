/* Types and functions that all methods share. `real` is double, long double for reference solutions, or a SIMD vector
   of doubles, for several members of an ensemble or several stages of a method. */
#include <math.h>
#include <string.h>
#include <time.h>

#define INLINE static inline __attribute__((always_inline))

#ifndef REAL
#define REAL double
#endif
typedef REAL real;

/* Type of the numbers of a state. It is double where `real` is a vector over the stages of a method. */
#ifndef STATE
#define STATE real
#endif

static double seconds_of(clockid_t clock)
{
    struct timespec now;
    clock_gettime(clock, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* CPU time of this thread, in seconds. The call takes as long as ten steps. */
static double cpu_time(void)
{
    return seconds_of(CLOCK_THREAD_CPUTIME_ID);
}

/* Elapsed time in seconds, for time limits, since the call is fast. */
static inline double wall_time(void)
{
    return seconds_of(CLOCK_MONOTONIC);
}

enum { OK = 0, NO_CONVERGENCE = 1, NOT_FINITE = 3, TOO_SLOW = 100 };
