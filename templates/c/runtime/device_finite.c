#ifndef PHI_FILE_DEVICE_FINITE
#define PHI_FILE_DEVICE_FINITE

static int phi_finite(const double *values, int count)
{
    int finite = 1;
    PHI_UNROLL for (int i = 0; i < count; ++i) finite = finite && isfinite(values[i]);
    return finite;
}

#endif
