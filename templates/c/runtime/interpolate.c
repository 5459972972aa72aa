#ifndef PHI_FILE_INTERPOLATE
#define PHI_FILE_INTERPOLATE
#include "solver.h"
#include "gauss.c"

phi_status phi_interpolate(const phi_solver *s, const double *fraction, size_t count, double *x)
{
    if (s == NULL || fraction == NULL || x == NULL) return PHI_BAD_ARGUMENT;
    const phi_history *past = &s->history;
    if (past->count == 0 || past->kicked) return PHI_BAD_ARGUMENT;
    double factor[PHI_NODES], z[PHI_UNKNOWNS], point[PHI_POINT], change[PHI_DIM];
    phi_start(s, point);
    for (size_t row = 0; row < count; ++row) {
        phi_factors_at(fraction[row], factor);
        for (int k = 0; k < PHI_UNKNOWNS; ++k) {
            z[k] = 0.0;
            for (int j = 0; j < PHI_NODES; ++j) z[k] += factor[j] * PHI_LAST_INCREMENTS(past)[k][j];
        }
        phi_stage_change(s->coef, point, z, change);
        for (int i = 0; i < PHI_DIM; ++i) x[row * PHI_DIM + (size_t)i] = s->x[i] + change[i];
    }
    return PHI_OK;
}
#endif
