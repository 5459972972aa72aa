#ifndef PHI_FILE_ADJOINT_STAGE
#define PHI_FILE_ADJOINT_STAGE
#include <float.h>
#include <math.h>
#include <string.h>

#include "algebra.c"
#include "model.h"
#include "solver.c"

/* ---- The transpose of steps ---- */
/* Derivatives of a number L, which the reverse pass carries from step to step. */
typedef struct {
#include "state_of_cotangent.h"
} phi_cotangent;

/* The tape of one step: the states before its flows; or the start and the changes of stages of a Gauss method; or the
   solutions of implicit stages; or the starts of explicit ones. */
typedef PHI_RECORD_OF_STEP;

#include "adjoint_path.c"
#include "adjoint_newton.c"
#include "adjoint_explicit.c"
#include "adjoint_splitting.c"
#include "adjoint_stages.c"

#include "adjoint_early.c"
#endif
