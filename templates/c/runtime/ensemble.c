#ifndef PHI_FILE_ENSEMBLE
#define PHI_FILE_ENSEMBLE
#include <math.h>

#include "model.h"
#if PHI_GROUPS
#include "groups.c"
#elif PHI_PACKS
#include "packs.c"
#else
#include "solver.c"
#endif

/* ---- Ensembles ---- */
#if PHI_GROUPS || PHI_PACKS
phi_status phi_ensemble(const phi_params *params, double *x, size_t members, double h, size_t steps,
    unsigned char *status)
{
    phi_status worst = isfinite(h) ? PHI_OK : PHI_BAD_ARGUMENT;
    const phi_params own = params != NULL ? *params : phi_default_params;
    size_t earliest = members;
    if (x == NULL && members > 0) return PHI_BAD_ARGUMENT;
#ifdef _OPENMP
#pragma omp parallel for schedule(dynamic)
#endif
    for (size_t first = 0; first < members; first += PHI_GROUP) {
        const phi_status group = phi_group_run(&own, x, members, first, h, steps, status);
        if (group == PHI_OK) continue;
#ifdef _OPENMP
#pragma omp critical
#endif
        if (first < earliest) {
            earliest = first;
            worst = group;
        }
    }
    return worst;
}

#else
#if PHI_TIMED
phi_status phi_ensemble_at(const phi_params *params, double *x, size_t members, double t0, double h, size_t steps,
    unsigned char *status)
#else
phi_status phi_ensemble(const phi_params *params, double *x, size_t members, double h, size_t steps,
    unsigned char *status)
#endif
{
    phi_status worst = isfinite(h) ? PHI_OK : PHI_BAD_ARGUMENT;
    const phi_params own = params != NULL ? *params : phi_default_params;
    if (x == NULL && members > 0) return PHI_BAD_ARGUMENT;
    for (size_t m = 0; m < members; ++m) {
        phi_solver s;
        double x0[PHI_DIM];
        for (size_t i = 0; i < PHI_DIM; ++i) x0[i] = x[i * members + m];
#if PHI_TIMED
        phi_status member = phi_init_at(&s, &own, x0, t0);
#else
        phi_status member = phi_init(&s, &own, x0);
#endif
        if (member == PHI_OK) {
            member = phi_integrate(&s, h, steps);
            for (size_t i = 0; i < PHI_DIM; ++i) x[i * members + m] = s.x[i];
        }
        if (status != NULL) status[m] = (unsigned char)member;
        if (worst == PHI_OK) worst = member;
    }
    return worst;
}
#endif
#if PHI_TIMED

phi_status phi_ensemble(const phi_params *params, double *x, size_t members, double h, size_t steps,
    unsigned char *status)
{
    return phi_ensemble_at(params, x, members, 0.0, h, steps, status);
}
#endif
#endif
