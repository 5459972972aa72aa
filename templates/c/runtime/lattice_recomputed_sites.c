#ifndef PHI_FILE_LATTICE_RECOMPUTED_SITES
#define PHI_FILE_LATTICE_RECOMPUTED_SITES
#include "lattice.h"
#include "model.h"

/* Make a part of the reverse pass of a flow, for row segments. go = 1: pull cotangents back and invert the flow. go =
   2: add the contributions to the cotangents of other sites. */
#endif
