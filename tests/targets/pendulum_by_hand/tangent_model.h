/* The same with its variation: coordinates 2 and 3, and components 2 and 3 of p. */
#ifndef TANGENT_MODEL_H
#define TANGENT_MODEL_H
#include "model.h"

static void phi_tangent_begin(const double *coef, const double p[4], double s[][PHI_TERMS + 1], double f[1])
{
    (void)coef, (void)f;
    for (int i = 0; i < 4; i += 2) {
        s[4 + i][0] = p[i + 1];
        s[5 + i][0] = -p[i];
    }
}

static void phi_tangent_order(const double *coef, const double p[4], double s[][PHI_TERMS + 1], const double f[1], int k)
{
    (void)coef, (void)p, (void)f;
    for (int i = 0; i < 4; ++i) {
        if (k > 0) s[4 + i][k] = 0.0;
        s[i][k + 1] = s[4 + i][k] / (k + 1);
    }
}

static void phi_tangent_field(const double *coef, const double p[4], const double m[4], double field[4])
{
    (void)coef, (void)m;
    for (int i = 0; i < 4; i += 2) {
        field[i] = p[i + 1];
        field[i + 1] = -p[i];
    }
}
#endif
