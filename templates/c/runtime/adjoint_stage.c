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

#if PHI_SPLITTING
/* Tape of one step: the states before its flows. */
#elif PHI_GAUSS
/* Tape of one step: its start and its stage increments. */
#elif PHI_EXPLICIT
/* Tape of one step: the states before its stages. */
#else
/* Tape of one step: the solutions of the equations of its stages. */
#endif
typedef PHI_RECORD_OF_STEP;

#include "adjoint_path.c"
#include "adjoint_newton.c"
#include "adjoint_explicit.c"
#include "adjoint_splitting.c"
#include "adjoint_stages.c"

#include "adjoint_early.c"
#endif
