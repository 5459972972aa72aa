/* What all methods share. `real` is double, long double for references, or a vector of doubles for ensembles. */
#include <math.h>
#include <string.h>
#include <time.h>

#define INLINE static inline __attribute__((always_inline))

#ifndef REAL
#define REAL double
#endif
typedef REAL real;

/* Numbers of a state: not the vectors in which a method keeps its stages. */
#ifndef STATE
#define STATE real
#endif

static double seconds_of(clockid_t clock)
{
    struct timespec now;
    clock_gettime(clock, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* CPU time of this thread, in seconds. To ask for it takes as long as ten steps. */
static double cpu_time(void)
{
    return seconds_of(CLOCK_THREAD_CPUTIME_ID);
}

/* Time by the clock, in seconds, which is cheap to ask for: for limits. */
static inline double wall_time(void)
{
    return seconds_of(CLOCK_MONOTONIC);
}

enum { OK = 0, NO_CONVERGENCE = 1, NOT_FINITE = 3, TOO_SLOW = 100 };
