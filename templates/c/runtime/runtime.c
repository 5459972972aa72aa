#include "solver.h"
#include "model.h"
#include "solver.c"
#if PHI_TANGENT
#include "tangent.c"
#endif
#if PHI_BLOCKS
#include "blocks.c"
#endif
#if PHI_ADJOINT && PHI_EACH
#include "adjoint_each.c"
#elif PHI_ADJOINT
#include "adjoint.c"
#endif
#if PHI_ENSEMBLE
#include "ensemble.c"
#endif
#if PHI_BLOCKS || PHI_PACKS || PHI_TRACED || PHI_STAGED

#if defined(__clang__)
#pragma clang diagnostic pop
#endif
#endif
