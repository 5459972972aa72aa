#ifndef PHI_FILE_CHAIN
#define PHI_FILE_CHAIN
#include <string.h>

#include "model.h"
#include "newton_lanes.c"

/* ---- The residuals of a block ---- */
#include "chain_swept.c"
#include "chain_by_points.c"

#endif
