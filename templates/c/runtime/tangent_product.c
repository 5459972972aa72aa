#ifndef PHI_FILE_TANGENT_PRODUCT
#define PHI_FILE_TANGENT_PRODUCT
#include "solver.h"

/* Compute the product of two matrices. */
static void phi_tangent_product(const double a[PHI_DIM * PHI_DIM], const double b[PHI_DIM * PHI_DIM], double product[PHI_DIM * PHI_DIM])
{
    for (int i = 0; i < PHI_DIM; ++i)
        for (int j = 0; j < PHI_DIM; ++j) {
            double sum = 0.0;
            for (int k = 0; k < PHI_DIM; ++k) sum += a[i * PHI_DIM + k] * b[k * PHI_DIM + j];
            product[i * PHI_DIM + j] = sum;
        }
}
#endif
