#include "solver.h"
#include "model.h"
#include "solver.c"
#include "tangent.c"
#include "blocks.c"
#include "adjoint_each.c"
#include "adjoint.c"
#include "ensemble.c"
#if PHI_BLOCKS || PHI_PACKS || PHI_TRACED || PHI_STAGED

#if defined(__clang__)
#pragma clang diagnostic pop
#endif
#endif
