#ifndef PHI_FILE_ATTITUDE_ORTHOGONAL
#define PHI_FILE_ATTITUDE_ORTHOGONAL
#include <string.h>

#include "attitude_matrices.c"

/* Correct the attitude increment 1 + factor so that its product with the nearly orthogonal matrix g is nearer to an
   orthogonal matrix. `factor` is overwritten. */
static void phi_normalise(const double g[PHI_ELEMENT], double factor[PHI_ELEMENT])
{
    enum { N = PHI_ROWS_OF_ATTITUDE };
    double excess[PHI_ELEMENT], change[PHI_ELEMENT];
    for (int i = 0; i < N; ++i)
        for (int j = 0; j < N; ++j) {
            double sum = i == j ? -1.0 : 0.0;
            for (int k = 0; k < N; ++k) sum += PHI_PRODUCT_WITH_TRANSPOSE(g, i, j, k, N);
            excess[i * N + j] = 0.5 * sum;
        }
    PHI_ADDED_FACTOR(excess, factor, change);
    for (int i = 0; i < PHI_ELEMENT; ++i) factor[i] -= excess[i] + change[i];
}

/* Correct a matrix so that 1 + element, which is nearly orthogonal, is nearer to an orthogonal matrix. */
static void phi_make_orthogonal(double element[PHI_ELEMENT])
{
    double full_element[PHI_ELEMENT];
    memcpy(full_element, element, sizeof full_element);
    phi_add_identity(full_element);
    phi_normalise(full_element, element);
}
#endif
