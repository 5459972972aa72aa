#ifndef PHI_FILE_LATTICE_TIME
#define PHI_FILE_LATTICE_TIME
#include "lattice.h"
#include "model.h"

phi_status phi_init(phi_solver *s, const phi_params *params, PHI_SIZES, const double *x0, void *work)
{
    return phi_init_at(s, params, sizes PHI_AND_GRAPH, x0, 0.0, work);
}
#endif
