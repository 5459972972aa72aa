#ifndef PHI_FILE_ATTITUDE_MATRICES
#define PHI_FILE_ATTITUDE_MATRICES
#include <float.h>
#include <math.h>
#include <string.h>
#include "model.h"

/* The product of two square matrices. */
static void phi_group_product(const double a[PHI_ELEMENT], const double b[PHI_ELEMENT], double product[PHI_ELEMENT])
{
    enum { N = PHI_ROWS_OF_ATTITUDE };
    for (int i = 0; i < N; ++i)
        for (int j = 0; j < N; ++j) {
            double sum = 0.0;
            for (int k = 0; k < N; ++k) sum += a[i * N + k] * b[k * N + j];
            product[i * N + j] = sum;
        }
}

/* Make a factor, given less 1, that brings a matrix which is nearly orthogonal nearer to that. */
static void phi_normalise(const double g[PHI_ELEMENT], double factor[PHI_ELEMENT])
{
    enum { N = PHI_ROWS_OF_ATTITUDE };
    double excess[PHI_ELEMENT], change[PHI_ELEMENT];
    for (int i = 0; i < N; ++i)
        for (int j = 0; j < N; ++j) {
            double sum = i == j ? -1.0 : 0.0;
#if PHI_SPATIAL
            for (int k = 0; k < N; ++k) sum += g[i * N + k] * g[j * N + k];
#else
            for (int k = 0; k < N; ++k) sum += g[k * N + i] * g[k * N + j];
#endif
            excess[i * N + j] = 0.5 * sum;
        }
    PHI_ADDED_FACTOR(excess, factor, change);
    for (int i = 0; i < PHI_ELEMENT; ++i) factor[i] -= excess[i] + change[i];
}

/* By how many halvings P becomes so small that its exponential is a short sum. */
static int phi_doublings(double square)
{
    int doublings = 0;
    for (; isfinite(square) && square > 0.25; square *= 0.25) ++doublings;
    return doublings;
}

/* exp(P) - 1: that of P/2^k, doubled k times. */
#if PHI_NORMALISE
/* Rounding doubles as well: what it takes from orthogonality is put back each time. */
#endif
static void phi_matrix_exponential(const double p[PHI_COVECTOR], double element[PHI_ELEMENT])
{
    double small[PHI_COVECTOR], square[PHI_ELEMENT];
    int doublings = phi_doublings(p[PHI_COVECTOR - 1]); /* a bound for the square of the size of P */
    if (doublings == 0) {
        phi_exponential(p, element);
        return;
    }
    for (int i = 0; i < PHI_COVECTOR; ++i) small[i] = ldexp(p[i], -doublings);
    phi_exponential(small, element);
    for (; doublings > 0; --doublings) {
        phi_group_product(element, element, square);
        for (int i = 0; i < PHI_ELEMENT; ++i) element[i] = 2.0 * element[i] + square[i];
#if PHI_NORMALISE
        memcpy(square, element, sizeof square);
        for (int i = 0; i < PHI_ELEMENT; i += PHI_ROWS_OF_ATTITUDE + 1) square[i] += 1.0;
        phi_normalise(square, element);
#endif
    }
}

/* The element, less 1, of the motion with a constant rate, for some time. */
static void phi_uniform(const double rate[PHI_RATE], double t, double element[PHI_ELEMENT])
{
    double p[PHI_RATE];
    for (int i = 0; i < PHI_COVECTOR - 1; ++i) p[i] = t * rate[i];
    p[PHI_COVECTOR - 1] = t * t * rate[PHI_COVECTOR - 1];
    phi_matrix_exponential(p, element);
}
#endif
