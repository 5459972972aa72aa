#ifndef PHI_FILE_DEVICE_ENSEMBLE
#define PHI_FILE_DEVICE_ENSEMBLE
#include "device_solver.c"
#include "device_gauge.c"
#include "device_lent.c"
#include "device_common.c"

/* ---- The kernel of ensembles ---- */
/* Work item m integrates member m; work items from m = members on do nothing, so that any size of work groups or blocks
   gives the same results. x[i * members + m] is coordinate i of member m: its initial state, which the final state
   replaces; failed members get their last good state. Member m has the parameters params[m] if params_per_member is 1, and
   params[0] if it is 0; the step size is h[m] if h_per_member is 1, and h[0] if it is 0. */
#if PHI_TIMED
/* The initial time of member m is t0[m] if start_per_member is 1, and t0[0] if it is 0. */
#elif PHI_GAUGE
/* gauge has PHI_GAUGES numbers for each member if start_per_member is 1, and PHI_GAUGES numbers that hold for all
   members if it is 0. If gauge is NULL, gauges are chosen at the initial states. */
#endif
/* `frames`, if not NULL, receives the states after every stride-th step: frames[(k * PHI_DIM + i) * members + m] is
   coordinate i of member m after (k + 1) * stride steps, NaN if the member failed before. status[m] is a phi_status. */
#if PHI_COMMON
/* If PHI_COMMON is defined, the first argument has the coefficients that all members share; params_per_member and
   h_per_member must then be 0. */
#endif
#if PHI_NOISE
/* Member m has the random numbers of seed and member number first_member + m, from the step number first_step on. */
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
