/* What all methods share. `real` is double, long double for references, or a vector of doubles for ensembles. */
#include <math.h>
#include <string.h>
#include <time.h>

#define INLINE static inline __attribute__((always_inline))

#ifndef REAL
#define REAL double
#endif
typedef REAL real;

/* CPU time of this thread, in seconds. */
static double cpu_time(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

enum { OK = 0, NOT_FINITE = 3, TOO_SLOW = 100 };
