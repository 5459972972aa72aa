/* The path dm/dt = pi p, constant: series 2 and 3 are those of dm/dt. */
#ifndef PATH_MODEL_H
#define PATH_MODEL_H
#include "model.h"

static void phi_path_begin(const double *coef, const double p[2], double s[][PHI_TERMS + 1], double f[1])
{
    (void)coef, (void)f;
    s[2][0] = p[1];
    s[3][0] = -p[0];
}

static void phi_path_order(const double *coef, const double p[2], double s[][PHI_TERMS + 1], const double f[1], int k)
{
    (void)coef, (void)p, (void)f;
    if (k > 0) s[2][k] = s[3][k] = 0.0;
    for (int i = 0; i < 2; ++i) s[i][k + 1] = s[2 + i][k] / (k + 1);
}

static void phi_path_field(const double *coef, const double p[2], const double m[2], double field[2])
{
    (void)coef, (void)m;
    field[0] = p[1];
    field[1] = -p[0];
}
#endif
