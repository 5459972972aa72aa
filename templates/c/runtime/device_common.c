#ifndef PHI_FILE_DEVICE_COMMON
#define PHI_FILE_DEVICE_COMMON
#include "device_solver.c"

/* ---- The kernel of coefficients ---- */
/* One work item computes the coefficients of steps of size h[0] with the parameters params[0]. Members that all have
   this step size and these parameters may share the coefficients: see PHI_COMMON. */
PHI_KERNEL void phi_coefficients_kernel(PHI_GLOBAL const phi_params *params, PHI_GAUGE_ARGUMENT PHI_GLOBAL const double *h,
    PHI_GLOBAL phi_coefficients *coefficients)
{
    if (PHI_WORK_ITEM > 0) return;
    const phi_params all = params[0];
    phi_coefficients computed;
    PHI_COPY_OF_GAUGE
    PHI_EACH_STAGE
        phi_prepare(&all PHI_AND_GAUGE(gauges), PHI_FRACTION(h[0]), PHI_OF(computed.coef, stage));
    *coefficients = computed;
}
#endif
