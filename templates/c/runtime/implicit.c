#ifndef PHI_FILE_IMPLICIT
#define PHI_FILE_IMPLICIT
#include <math.h>
#include <string.h>

#include "model.h"

#include "recurrence.c"

#include "predictor.c"
#include "plausibility_policy.h"

/* Whether an increment is plausible: it is short, or changes the energy little. The equation of a step that is too large
   may have solutions far away, at another energy, unrelated to the motion. */
static int phi_plausible(const phi_solver *s PHI_AND_INT_STAGE, const double increment[PHI_DIM])
{
    double distance = 0.0, size = 0.0, field[PHI_DIM], point[PHI_DIM], H[3];
    for (int i = 0; i < PHI_DIM; ++i) {
        distance += fabs(increment[i]);
        size += fabs(s->x[i]);
    }
    if (distance <= PHI_PLAUSIBLE * size) return 1;
    phi_vector_field(&s->params PHI_AND_T(s->t), s->x, field);
#if PHI_MONITOR
    const double rate = phi_monitor(&s->params, s->x);
    for (int i = 0; i < PHI_DIM; ++i) size += fabs(PHI_FRACTION(s->h) * rate * field[i]);
#else
    for (int i = 0; i < PHI_DIM; ++i) size += fabs(PHI_FRACTION(s->h) * field[i]);
#endif
#if PHI_NOISE
    double fields[PHI_SOURCES * PHI_DIM];
    phi_noise_fields(&s->params PHI_AND_T(s->t), s->x, fields);
    for (int k = 0; k < PHI_SOURCES * PHI_DIM; ++k) size += fabs(s->dw[k / PHI_DIM] * fields[k]);
#endif
    if (distance <= PHI_PLAUSIBLE * size) return 1;
    for (int k = 0; k < 3; ++k) { /* energy at the start, halfway, and at the end */
        for (int i = 0; i < PHI_DIM; ++i) point[i] = s->x[i] + 0.5 * (double)k * increment[i];
        H[k] = phi_hamiltonian(&s->params PHI_AND_T(s->t), point);
    }
    return fabs(H[2] - H[0]) <= PHI_MAX_ENERGY_CHANGE * (fabs(H[0]) + fabs(H[1]) + fabs(H[2]));
}
#endif
