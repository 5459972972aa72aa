#ifndef PHI_FILE_ADJOINT_NEWTON_SPARSE
#define PHI_FILE_ADJOINT_NEWTON_SPARSE
#include <string.h>

#include "adjoint_lanes.c"

/* Set the matrices to 0, since the kernels write only entries that can be different from 0. */
static void phi_clear_zeros(phi_lanes jacobian[PHI_DIM * PHI_DIM], phi_lanes slope[PHI_DIM * PHI_DIM])
{
    memset(jacobian, 0, PHI_DIM * PHI_DIM * sizeof jacobian[0]);
    memset(slope, 0, PHI_DIM * PHI_DIM * sizeof slope[0]);
}
#endif
