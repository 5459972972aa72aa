#ifndef PHI_FILE_LATTICE_TANGENT
#define PHI_FILE_LATTICE_TANGENT
#include <stdint.h>

#include "lattice.h"
#include "model.h"

/* ---- Tangent vectors ---- */
size_t phi_tangent_size(const phi_solver *s, size_t count)
{
    const size_t block = PHI_DIM * PHI_DOUBLES;
    return count > SIZE_MAX / 16 / block - 2 ? 0 : (count + 2) * block * sizeof(double) + 64;
}

#include "lattice_tangent_stages.c"
#include "lattice_tangent_flows.c"

phi_status phi_integrate_tangent(phi_solver *s, double h, size_t steps, size_t count, double *v, void *work)
{
    phi_status status = phi_set_step(s, h);
    if (status != PHI_OK || v == NULL || work == NULL || !phi_finite(v, count * PHI_DIM * s->sites)) return PHI_BAD_ARGUMENT;
    s->tangents = PHI_FIRST_SITE((double *)(void *)((char *)work + (64 - (uintptr_t)work % 64) % 64));
    double *fields[PHI_DIM];
    for (size_t k = 0; k < count; ++k) {
        phi_vector(s, k, fields);
        for (size_t f = 0; f < PHI_DIM; ++f) phi_put(s, fields[f], v + (k * PHI_DIM + f) * s->sites);
        phi_to_relative(s, fields);
    }
    phi_to_relative(s, s->x);
    phi_clear_other_carry(s);
    s->vectors = count;
    for (; steps > 0 && status == PHI_OK; --steps) {
        phi_copy(s->before, s->x, s);
        status = phi_carry(s);
        s->steps += status == PHI_OK;
        PHI_SET_TIME(s) PHI_TIME_AFTER(s, s->steps);
    }
    s->vectors = 0;
    if (status != PHI_OK) phi_copy(s->x, s->before, s);
    phi_to_cartesian(s, s->x);
#if PHI_SERIES
    if (status != PHI_OK) phi_forget(s);
#endif
    for (size_t k = 0; k < count && status == PHI_OK; ++k) {
        phi_vector(s, k, fields);
        if (!phi_all_hold(s, fields)) status = PHI_NOT_FINITE;
    }
    for (size_t k = 0; k < count && status == PHI_OK; ++k) {
        phi_vector(s, k, fields);
        phi_to_cartesian(s, fields);
        phi_take(s, fields, v + k * PHI_DIM * s->sites);
    }
    return status;
}

phi_status phi_step_tangent(phi_solver *s, double h, size_t count, double *v, void *work)
{
    return phi_integrate_tangent(s, h, 1, count, v, work);
}
#endif
