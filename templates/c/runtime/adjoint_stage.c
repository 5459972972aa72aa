#ifndef PHI_FILE_ADJOINT_STAGE
#define PHI_FILE_ADJOINT_STAGE
#include <float.h>
#include <math.h>
#include <string.h>

#include "algebra.c"
#include "model.h"
#include "solver.c"

/* ---- The transpose of steps ---- */
#if PHI_PATH
#include "adjoint_path.h"
#elif PHI_SPLITTING
#include "adjoint_flows.h"
#endif

/* What is pulled back through steps: the derivatives of a number along the state, and along the coefficients of each
   stage. */
typedef struct {
    double x[PHI_DIM];
    double PHI_OF(coef, PHI_STAGES)[PHI_COEFFICIENTS];
#if PHI_PATH
    double end[PHI_DIM]; /* where the state was that x belongs to */
#endif
} phi_cotangent;

/* What is kept of a step for the way back: the states before its flows, or the points that its stages have solved for or
   begun at. */
#if PHI_SPLITTING
typedef double phi_kept[PHI_FLOWS][PHI_DIM];
#elif PHI_GAUSS
typedef double phi_kept[PHI_TRAIL]; /* where it starts, and the moves of its stages */
#else
typedef double PHI_OF(phi_kept, PHI_STAGES)[PHI_DIM];
#endif

#include "adjoint_path.c"
#include "adjoint_newton.c"
#include "adjoint_explicit.c"
#include "adjoint_splitting.c"

#if PHI_RENEWED
/* Pull the cotangents of coefficients that depend on the time back to those of the others of their row. */
static void phi_early(const double *coef, double *coef_bar, double t)
{
    double found[PHI_PREPARED + 1];
    phi_at_time_adjoint(coef, t, coef_bar + PHI_PREPARED, found);
    for (int k = 0; k < PHI_PREPARED; ++k) coef_bar[k] += found[k];
    memset(coef_bar + PHI_PREPARED, 0, PHI_RENEWED_OF_ROW * sizeof coef_bar[0]);
}

#endif
#endif
