#ifndef PHI_FILE_LATTICE_UNDOING_SITES
#define PHI_FILE_LATTICE_UNDOING_SITES
#include "lattice.h"
#include "model.h"

/* Pull cotangents back through a flow, and undo it, or hand what that has found, at pieces of rows. */
#endif
