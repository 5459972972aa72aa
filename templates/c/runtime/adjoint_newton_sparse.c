#ifndef PHI_FILE_ADJOINT_NEWTON_SPARSE
#define PHI_FILE_ADJOINT_NEWTON_SPARSE
#include <string.h>

#include "adjoint_lanes.c"

/* Set matrices to 0: the generated kernels write non-zero entries only. */
static void phi_clear_zeros(phi_lanes jacobian[PHI_DIM * PHI_DIM], phi_lanes slope[PHI_DIM * PHI_DIM])
{
    memset(jacobian, 0, PHI_DIM * PHI_DIM * sizeof jacobian[0]);
    memset(slope, 0, PHI_DIM * PHI_DIM * sizeof slope[0]);
}
#endif
