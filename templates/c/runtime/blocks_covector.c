#ifndef PHI_FILE_BLOCKS_COVECTOR
#define PHI_FILE_BLOCKS_COVECTOR
#include "blocks.c"

/* Compute exp(P) - 1 in all lanes, for the matrices P that the numbers p define. */
static void phi_matrix_exponential_lanes(phi_lanes p[PHI_COVECTOR], phi_lanes element[PHI_ELEMENT])
{
    const int doublings = phi_doublings(phi_largest(p[PHI_COVECTOR - 1]));
    if (doublings == 0) {
        phi_exponential_lanes(p, element);
        return;
    }
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        double one[PHI_COVECTOR], exponential[PHI_ELEMENT];
        for (int i = 0; i < PHI_COVECTOR; ++i) one[i] = p[i][lane];
        phi_matrix_exponential(one, exponential);
        for (int i = 0; i < PHI_ELEMENT; ++i) element[i][lane] = exponential[i];
    }
}

/* Compute the attitude increments of a stage in all lanes, as differences from the identity. */
static void phi_factor_lanes(phi_lanes *coef, phi_lanes *y, phi_lanes turns[PHI_ELEMENT])
{
    phi_lanes p[PHI_COVECTOR];
    phi_turn_lanes(coef, y, p);
    phi_matrix_exponential_lanes(p, turns);
}
#endif
