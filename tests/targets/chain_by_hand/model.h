#ifndef MODEL_H
#define MODEL_H
#include <math.h>

#include "declarations.h"

const phi_params phi_default_params = { 1.5 };

/* Strang's splitting: half a drift, a kick, half a drift; and two halves together. */
enum { PHI_LEAD = 8, PHI_RESERVED = PHI_ARRAYS + PHI_DIM };
enum { PHI_LINES = 3, PHI_ROW = 1, PHI_FLOWS = 3, PHI_ROWS_OF_FLOWS = 4, PHI_WEIGHTS = 2 };

static const size_t phi_least[PHI_AXES] = { 2, 2 };
static const int phi_open[PHI_AXES] = { 0, 1 };
static const int phi_lines[PHI_LINES][PHI_AXES] = { { 0, 0 }, { -1, 0 }, { 1, 0 } };
static const int phi_weights[PHI_WEIGHTS][PHI_AXES][2] = { { { 0, 0 }, { 0, 1 } }, { { 0, 0 }, { -1, 0 } } };
static const double phi_times[PHI_ROWS_OF_FLOWS] = { 0.5, 1.0, 0.5, 1.0 };
static const unsigned char phi_flow_parts[PHI_ROWS_OF_FLOWS] = { 1, 2, 1, 1 };

static int phi_allowed(const phi_params *params, size_t sites)
{
    (void)sites;
    return isfinite(params->g);
}

static void phi_prepare(const phi_params *params, double h, double coef[PHI_ROW])
{
    (void)params;
    coef[0] = h;
}
#endif
