#ifndef PHI_FILE_DEVICE_ENSEMBLE
#define PHI_FILE_DEVICE_ENSEMBLE
#include "device_solver.c"
#include "device_gauge.c"
#include "device_lent.c"
#include "device_common.c"

/* ---- The kernel of ensembles ---- */
/* Each work item integrates one member; work items beyond members do nothing, so that any size of work groups or blocks
   gives the same results. x[i * members + m] is coordinate i of member m, first at the start, then at the end; failed
   members have the last good state. If params_per_member is 1, member m has the parameters params[m]; if it is 0, all have
   params[0]. h_per_member selects h[m] or h[0] likewise. */
#if PHI_TIMED
/* start_per_member selects t0[m] or t0[0] likewise. */
#elif PHI_GAUGE
/* start_per_member selects the PHI_GAUGES numbers of each member, or those of member 0, in gauge. NULL: gauges chosen at the
   initial states. */
#endif
/* frames, if not NULL, receives the states after every stride-th step: frames[(k * PHI_DIM + i) * members + m] is
   coordinate i of member m after (k + 1) * stride steps, NaN if the member failed before. status[m] is a phi_status. */
#if PHI_COMMON
/* If PHI_COMMON is defined, the first argument is the coefficients of all members: params_per_member and
   h_per_member are 0. */
#endif
#if PHI_NOISE
/* Member m has the random numbers of first_member + m, from the step first_step on, as in phi_ensemble_of. */
#endif
PHI_KERNEL void phi_ensemble_kernel(PHI_COMMON_ARGUMENT uint64_t members, PHI_GLOBAL const phi_params *params, int params_per_member,
    PHI_GLOBAL double *x,
    PHI_OWN_STARTS
    PHI_GLOBAL const double *h, int h_per_member, uint64_t steps,
    PHI_RANDOM_NUMBERS
    uint64_t stride, PHI_GLOBAL double *frames, PHI_GLOBAL unsigned char *status)
{
    const uint64_t m = PHI_WORK_ITEM;
    phi_solver s;
    PHI_LENT_MEMORY
    double start[PHI_DIM];
    if (m >= members) return;
    for (int i = 0; i < PHI_DIM; ++i) start[i] = x[i * members + m];
    const phi_params member = params[params_per_member ? m : 0];
    PHI_GAUGE_OF_MEMBER(level)
    phi_status ended = PHI_INIT_OWN(&s, &member, start, t0[start_per_member ? m : 0], level);
    const int begun = ended == PHI_OK;
    PHI_SET_NOISE(&s)
    PHI_LEND(&s)
    PHI_TAKE_COMMON(&s)
    uint64_t done = 0;
    PHI_NO_UNROLL
    do {
        const uint64_t left = steps - done, next = frames != NULL && stride - done % stride < left ? stride - done % stride : left;
        if (ended == PHI_OK) ended = phi_integrate(&s, h[h_per_member ? m : 0], next);
        done += next;
        if (frames != NULL && done > 0 && done % stride == 0)
            for (int i = 0; i < PHI_DIM; ++i)
                frames[((done / stride - 1) * PHI_DIM + i) * members + m] = ended == PHI_OK ? s.x[i] : (double)NAN;
    } while (done < steps);
    for (int i = 0; i < PHI_DIM; ++i) x[i * members + m] = begun ? s.x[i] : start[i];
    status[m] = (unsigned char)ended;
}
#endif
