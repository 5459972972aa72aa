/* The path traced back: the state, its cotangent (constant but for that of the mean), and the cotangent of p. */
#ifndef ADJOINT_PATH_H
#define ADJOINT_PATH_H
#include "model.h"

static const int phi_back_used[1] = { 0 };

static void phi_back_begin(const double *coef, const double p[6], double s[][PHI_TERMS + 1], double f[1])
{
    (void)coef, (void)f;
    s[6][0] = -p[1];
    s[7][0] = p[0];
    s[8][0] = p[2];
    s[9][0] = p[3];
    s[10][0] = -s[3][0];
    s[11][0] = s[2][0];
}

static void phi_back_order(const double *coef, const double p[6], double s[][PHI_TERMS + 1], const double f[1], int k)
{
    (void)coef, (void)p, (void)f;
    for (int i = 6; i < 10 && k > 0; ++i) s[i][k] = 0.0;
    if (k > 0) {
        s[10][k] = -s[3][k];
        s[11][k] = s[2][k];
    }
    for (int i = 0; i < 6; ++i) s[i][k + 1] = s[6 + i][k] / (k + 1);
}

static void phi_back_field(const double *coef, const double p[6], const double m[6], double field[6])
{
    (void)coef;
    field[0] = -p[1];
    field[1] = p[0];
    field[2] = p[2];
    field[3] = p[3];
    field[4] = -m[3];
    field[5] = m[2];
}
#endif
