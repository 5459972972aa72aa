#ifndef PHI_FILE_ATTITUDE_MATRICES
#define PHI_FILE_ATTITUDE_MATRICES
#include <float.h>
#include <math.h>
#include <string.h>
#include "model.h"

/* Compute the product of two square matrices. */
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

/* Add the identity matrix to a matrix. */
static inline void phi_add_identity(double element[PHI_ELEMENT])
{
    for (int i = 0; i < PHI_ELEMENT; i += PHI_ROWS_OF_ATTITUDE + 1) element[i] += 1.0;
}

#include "attitude_orthogonal.c"

/* Number of times that a matrix must be halved until its norm is at most 1/2; `square` is the square of its norm. */
static int phi_doublings(double square)
{
    int doublings = 0;
    for (; isfinite(square) && square > 0.25; square *= 0.25) ++doublings;
    return doublings;
}

/* Compute exp(P) - 1, where the numbers p define the matrix P: exp(P/2^k) is squared k times. Each squaring doubles
   rounding errors, so orthogonal matrices are made orthogonal again after it. */
static void phi_matrix_exponential(const double p[PHI_COVECTOR], double element[PHI_ELEMENT])
{
    double scaled[PHI_COVECTOR], square[PHI_ELEMENT];
    int doublings = phi_doublings(p[PHI_COVECTOR - 1]); /* the last number of p bounds the squared norm of P */
    if (doublings == 0) {
        phi_exponential(p, element);
        return;
    }
    for (int i = 0; i < PHI_COVECTOR; ++i) scaled[i] = ldexp(p[i], -doublings);
    phi_exponential(scaled, element);
    for (; doublings > 0; --doublings) {
        phi_group_product(element, element, square);
        for (int i = 0; i < PHI_ELEMENT; ++i) element[i] = 2.0 * element[i] + square[i];
        phi_make_orthogonal(element);
    }
}

/* Compute the group element of a motion for the time t with a constant rate; `element` is its difference from the
   identity. */
static void phi_uniform(const double rate[PHI_RATE], double t, double element[PHI_ELEMENT])
{
    double p[PHI_RATE];
    for (int i = 0; i < PHI_COVECTOR - 1; ++i) p[i] = t * rate[i];
    p[PHI_COVECTOR - 1] = t * t * rate[PHI_COVECTOR - 1];
    phi_matrix_exponential(p, element);
}

/* Set the initial attitude s->first; s->turned, the product of all later increments, becomes the identity. */
static void phi_take_element(phi_solver *s, const double first[PHI_ELEMENT])
{
    memmove(s->first, first, sizeof s->first);
    memset(s->turned, 0, sizeof s->turned);
    phi_add_identity(s->turned);
}

/* Update s->attitude, which users read. */
static void phi_read_attitude(phi_solver *s) { PHI_READ_PRODUCT(s) }
#endif
