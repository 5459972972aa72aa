#ifndef PHI_FILE_START
#define PHI_FILE_START
#include "solver.h"

phi_status phi_init(phi_solver *s, const phi_params *params, const double x0[PHI_DIM])
{
    return PHI_INIT_FROM(s, params, x0 PHI_AND_USUAL_START);
}
#endif
