#ifndef PHI_FILE_DEVICE_MEMORY
#define PHI_FILE_DEVICE_MEMORY
static inline void phi_copy(double *to, const double *from, int count)
{
    PHI_UNROLL
    for (int i = 0; i < count; ++i) to[i] = from[i];
}

static inline void phi_clear(double *to, int count)
{
    PHI_UNROLL
    for (int i = 0; i < count; ++i) to[i] = 0.0;
}
#endif
