#ifndef PHI_FILE_ENSEMBLE
#define PHI_FILE_ENSEMBLE
#include <math.h>

#include "model.h"
#include "group_run.c"
#include "batches.c"
#include "members.c"
#include "solver.c"
#include "attitudes.c"
#include "first_failure.c"

#if PHI_EACH || PHI_NOISE
/* ---- Ensembles ---- */
#endif
#if PHI_GROUPS || PHI_PACKS || PHI_STAGE_GROUPS
/* Integrate all members. Returns the first status that is not OK. */
static phi_status phi_run(const phi_members *all)
{
    phi_status result = PHI_OK;
    size_t earliest = all->members;
#ifdef _OPENMP
#pragma omp parallel for schedule(dynamic)
#endif
    for (size_t first = 0; first < all->members; first += PHI_GROUP) {
        phi_report_first(phi_group_run(all, first), first, &earliest, &result);
    }
    return result;
}

#elif PHI_EACH
/* Integrate all members. Returns the first status that is not OK. */
static phi_status phi_run(const phi_members *all)
{
    phi_status result = PHI_OK;
    for (size_t m = 0; m < all->members; ++m) {
        phi_solver s;
        double x[PHI_DIM];
        const phi_status begun = phi_take_member(all, m, x, &s);
        const phi_status status = phi_end_member(all, m, 0, &s, begun);
        phi_put_member(all, m, begun == PHI_OK ? s.x : x, status);
        if (result == PHI_OK) result = status;
    }
    return result;
}

#endif
#if PHI_EACH || PHI_GROUPS || PHI_PACKS || PHI_STAGE_GROUPS
phi_status PHI_ENSEMBLE_AT(const phi_params *params, double *x, size_t members PHI_AND_T0, double h, size_t steps,
    unsigned char *status)
{
    const phi_params shared = params != NULL ? *params : phi_default_params;
    phi_members all = phi_asked(&shared, x, members, &h, steps, status);
    if (x == NULL && members > 0) return PHI_BAD_ARGUMENT;
#if PHI_TIMED
    all.t0 = &t0;
#endif
    const phi_status result = phi_run(&all);
    return isfinite(h) ? result : PHI_BAD_ARGUMENT;
}

#else
phi_status PHI_ENSEMBLE_OF(const phi_params *params, double *x, size_t members PHI_AND_T0, double h, size_t steps,
    PHI_RANDOM_NUMBERS unsigned char *status)
{
    phi_status result = isfinite(h) ? PHI_OK : PHI_BAD_ARGUMENT;
#if PHI_NOISE
    size_t earliest = members;
#endif
    if (x == NULL && members > 0) return PHI_BAD_ARGUMENT;
#if PHI_NOISE
#ifdef _OPENMP
#pragma omp parallel for schedule(dynamic, 16)
#endif
#endif
    for (size_t m = 0; m < members; ++m) {
        phi_solver s;
        for (size_t i = 0; i < PHI_DIM; ++i) s.x[i] = x[i * members + m];
        phi_status ended = PHI_INIT_AT(&s, params, s.x, t0);
#if PHI_NOISE
        if (ended == PHI_OK) phi_set_noise(&s, seed, first_member + (uint32_t)m, first_step);
#endif
        if (ended == PHI_OK) ended = phi_integrate(&s, h, steps);
        for (size_t i = 0; i < PHI_DIM; ++i) x[i * members + m] = s.x[i];
        if (status != NULL) status[m] = (unsigned char)ended;
#if PHI_NOISE
        phi_report_first(ended, m, &earliest, &result);
#else
        if (result == PHI_OK) result = ended;
#endif
    }
    return result;
}
#endif
#if PHI_NOISE && PHI_TIMED

phi_status phi_ensemble_at(const phi_params *params, double *x, size_t members, double t0, double h, size_t steps,
    unsigned char *status)
{
    return phi_ensemble_of(params, x, members, t0, h, steps, 0, 0, 0, status);
}
#elif PHI_NOISE

phi_status phi_ensemble(const phi_params *params, double *x, size_t members, double h, size_t steps,
    unsigned char *status)
{
    return phi_ensemble_of(params, x, members, h, steps, 0, 0, 0, status);
}
#endif
#if PHI_TIMED

phi_status phi_ensemble(const phi_params *params, double *x, size_t members, double h, size_t steps,
    unsigned char *status)
{
    return phi_ensemble_at(params, x, members, 0.0, h, steps, status);
}
#endif
#if PHI_EACH

#if PHI_TIMED
phi_status phi_ensemble_each(const phi_params *params, double *x, size_t members, const double *t0, const double *h,
    size_t steps, size_t stride, double *frames, unsigned char *status)
#elif PHI_GAUGE
phi_status phi_ensemble_each(const phi_params *params, double *x, size_t members, const double *gauge,
    const double *h, size_t steps, size_t stride, double *frames, unsigned char *status)
#else
phi_status phi_ensemble_each(const phi_params *params, double *x, size_t members, const double *h, size_t steps,
    size_t stride, double *frames, unsigned char *status)
#endif
{
    phi_members all = phi_asked(params, x, members, h, steps, status);
    if (members > 0 && (x == NULL || h == NULL)) return PHI_BAD_ARGUMENT;
    if (frames != NULL && stride == 0) return PHI_BAD_ARGUMENT;
#if PHI_TIMED
    if (members > 0 && t0 == NULL) return PHI_BAD_ARGUMENT;
    all.t0 = t0;
#endif
#if PHI_GAUGE
    all.gauge = gauge;
#endif
    all.per_member = 1;
    all.stride = frames != NULL ? stride : 0;
    all.frames = frames;
    return phi_run(&all);
}
#endif
#endif
