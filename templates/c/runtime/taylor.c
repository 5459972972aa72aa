#ifndef PHI_FILE_TAYLOR
#define PHI_FILE_TAYLOR
#include "model.h"

/* Coefficient k of the product of two Taylor series, whose coefficients are the entries of a and b. */
static double phi_taylor_product(const double *a, const double *b, int k)
{
    double sum = 0.0;
    for (int j = 0; j <= k; ++j) sum += a[j] * b[k - j];
    return sum;
}

/* Coefficient k >= 1 of the Taylor series of f(a), from f(a)' = f'(a) a'. The arrays a and d have the coefficients of a
   and of f'(a). */
static double phi_taylor_chain(const double *a, const double *d, int k)
{
    double sum = 0.0;
    for (int j = 1; j <= k; ++j) sum += (double)j * a[j] * d[k - j];
    return sum / (double)k;
}

/* a[0] times coefficient k >= 1 of the Taylor series of b = a^r, from a b' = r a' b; coefficients of b before k are known. */
static double phi_taylor_power(const double *a, const double *b, double r, int k)
{
    double sum = 0.0;
    for (int j = 1; j <= k; ++j) sum += ((r + 1.0) * (double)j - (double)k) * a[j] * b[k - j];
    return sum / (double)k;
}
#endif
