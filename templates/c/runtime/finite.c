#ifndef PHI_FILE_FINITE
#define PHI_FILE_FINITE
#include <math.h>

static int phi_finite(const double *values, int count)
{
    while (count > 0 && isfinite(values[count - 1])) --count;
    return count == 0;
}

#endif
