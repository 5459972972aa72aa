#ifndef PHI_FILE_ADJOINT_STAGE
#define PHI_FILE_ADJOINT_STAGE
#include <float.h>
#include <math.h>
#include <string.h>

#include "algebra.c"
#include "model.h"
#include "solver.c"

/* ---- Reverse pass of steps ---- */
/* Derivatives of a number L, which the reverse pass carries from step to step. */
typedef struct {
#include "state_of_cotangent.h"
} phi_cotangent;

/* Tape of one step: the states before its flows (splitting), the start and the stage increments (Gauss), the solutions
   of implicit stages, or the starts of explicit stages. */
typedef PHI_RECORD_OF_STEP;

#include "adjoint_path.c"
#include "adjoint_newton.c"
#include "adjoint_explicit.c"
#include "adjoint_splitting.c"
#include "adjoint_stages.c"

#include "adjoint_early.c"
#endif
