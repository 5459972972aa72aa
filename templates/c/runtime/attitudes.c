#ifndef PHI_FILE_ATTITUDES
#define PHI_FILE_ATTITUDES
#include <math.h>

#include "attitude.c"
#include "first_failure.c"
#include "members.c"
#include "model.h"
#include "noise.c"

/* ---- Members with attitudes ---- */
/* Initialise a solver for member m: its state, its attitude and its random numbers. */
static phi_status phi_take_turned(const phi_members *all, size_t m, double x[PHI_DIM], phi_solver *s)
{
    double element[PHI_ELEMENT];
    phi_status status = phi_take_member(all, m, x, s);
    for (size_t i = 0; i < PHI_ELEMENT; ++i) element[i] = all->attitude[i * all->members + m];
    if (status == PHI_OK) status = phi_set_attitude(s, element PHI_AND_POSITION(element + 4));
#if PHI_NOISE
    if (status == PHI_OK) status = phi_set_noise(s, all->seed, all->first_member + (uint32_t)m, all->first_step);
#endif
    return status;
}

/* Integrate member m from start to end, and write its last state and attitude. */
static phi_status phi_turn_member(const phi_members *all, size_t m)
{
    phi_solver s;
    double x[PHI_DIM], element[PHI_ELEMENT];
    const phi_status begun = phi_take_turned(all, m, x, &s);
    const phi_status status = phi_end_member(all, m, 0, &s, begun);
    phi_put_member(all, m, begun == PHI_OK ? s.x : x, status);
    if (begun != PHI_OK) return status;
    phi_attitude(&s, element);
    for (size_t i = 0; i < PHI_ELEMENT; ++i) all->attitude[i * all->members + m] = element[i];
    return status;
}

/* The arguments have the order of phi_ensemble_each and phi_ensemble_of. */
phi_status phi_ensemble_attitudes(const phi_params *params, double *x, double *attitude, size_t members,
    PHI_OWN_POINTER
    const double *h, size_t steps,
    PHI_RANDOM_NUMBERS
    size_t stride, double *frames, double *attitudes, unsigned char *status)
{
    phi_members all = phi_asked(params, x, members, h, steps, status);
    phi_status worst = PHI_OK;
    size_t earliest = members;
    if (members > 0 && (x == NULL || attitude == NULL || h == NULL)) return PHI_BAD_ARGUMENT;
    if ((frames != NULL || attitudes != NULL) && stride == 0) return PHI_BAD_ARGUMENT;
#if PHI_TIMED
    if (members > 0 && t0 == NULL) return PHI_BAD_ARGUMENT;
    all.t0 = t0;
#elif PHI_GAUGE
    all.gauge = gauge;
#endif
#if PHI_NOISE
    all.seed = seed;
    all.first_member = first_member;
    all.first_step = first_step;
#endif
    all.per_member = 1;
    all.stride = frames != NULL || attitudes != NULL ? stride : 0;
    all.frames = frames;
    all.attitude = attitude;
    all.attitudes = attitudes;
#ifdef _OPENMP
#pragma omp parallel for schedule(dynamic, 16)
#endif
    for (size_t m = 0; m < members; ++m) {
        phi_report_first(phi_turn_member(&all, m), m, &earliest, &worst);
    }
    return worst;
}
#endif
