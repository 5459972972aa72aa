#ifndef PHI_FILE_LATTICE_RECOMPUTED_SITES
#define PHI_FILE_LATTICE_RECOMPUTED_SITES
#include "lattice.h"
#include "model.h"

/* Reverse pass of a flow for row segments: go = 1 pulls cotangents back and inverts the flow; go = 2 passes
   contributions to other rows on. */
#endif
