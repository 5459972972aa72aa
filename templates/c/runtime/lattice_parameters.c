#ifndef PHI_FILE_LATTICE_PARAMETERS
#define PHI_FILE_LATTICE_PARAMETERS
#include "lattice.h"
#include "model.h"
#include "rows.c"

phi_status phi_set_parameters(phi_solver *s, const phi_params *params)
{
    if (s == NULL || params == NULL || !phi_allowed(params, s->sites PHI_AND_NUMBER_OF_BONDS)) return PHI_BAD_ARGUMENT;
    double coef[PHI_COEFFICIENTS] = { 0.0 };
    phi_prepare_step(params, PHI_PROBE_STEP, coef);
    if (!phi_finite(coef, PHI_COEFFICIENTS)) return PHI_BAD_ARGUMENT;
    s->params = *params;
    phi_put_parameters(s, params);
    phi_put_at_bonds(s, params);
    s->prepared = 0; /* so that the next step computes all coefficients */
    PHI_NOT_OPEN(s)
    PHI_NOT_FULL_RANGE(s)
    phi_clear_carry(s);
#if PHI_BODIES
    if (!phi_weigh(s)) return PHI_BAD_ARGUMENT;
#endif
#if PHI_MONITOR
    if (!phi_take_level(s)) return PHI_BAD_ARGUMENT;
#endif
    return PHI_OK;
}
#endif
