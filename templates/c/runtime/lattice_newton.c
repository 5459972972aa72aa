#ifndef PHI_FILE_LATTICE_NEWTON
#define PHI_FILE_LATTICE_NEWTON
#include <math.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "sweeps.h"

#include "lattice_band.c"
#include "lattice_krylov.c"

/* ---- Newton's method, for stages that fixed-point sweeps do not solve ---- */
#include "lattice_newton_policy.h"
#include "lattice_sweep_policy.h"

/* The sum of |y - x| + `added` * |x| over all fields and sites, for y = s->y[side]. */
static double phi_distance(const phi_solver *s, int side, double added)
{
    double sum = 0.0;
    PHI_EACH_ROW
        for (int k = 0; k < PHI_DIM; ++k) {
            const double *y = PHI_ROW_AT(s->y[side][k]), *x = PHI_ROW_AT(s->x[k]);
            for (ptrdiff_t i = 0; i < s->length; ++i) sum += fabs(y[i] - x[i]) + added * fabs(x[i]);
        }
    return sum;
}

#if PHI_BANDED
/* Make a Newton correction of s->y[now]; s->y[1 - now] receives the result. Factors of the matrix are reused as long as the
   corrections shrink. */
#else
/* Make a Newton correction of s->y[now], by a linear equation solved in a Krylov space; s->y[1 - now] receives the result. */
#endif
/* Returns the largest change of a field relative to its size; not finite on failure. */
static double phi_corrected(phi_solver *s, const double *coef, int now)
{
#if PHI_BANDED
    if (s->factored != coef && !phi_factorise(s, coef, now)) return HUGE_VAL;
    s->factored = coef;
    if (!isfinite(phi_relaxed(s, coef PHI_AND_FULL_RANGE(1), now))) return HUGE_VAL;
    phi_eliminate(s, now);
#else
    if (!isfinite(phi_relaxed(s, coef PHI_AND_FULL_RANGE(1), now))) return HUGE_VAL;
    phi_combine(s, s->space[0], 1.0, s->y[now], -1.0, s->y[1 - now]);
#if PHI_SITE_BLOCKS
    phi_invert_blocks(s, coef, now);
#endif
    if (!isfinite(phi_krylov(s, coef, now, s->y[now], s->y[1 - now]))) return HUGE_VAL;
#endif
    return phi_relaxed(s, NULL PHI_AND_FULL_RANGE(1), now);
}

/* Largest accepted distance of a solution from x. Solutions farther away are unrelated to the motion. */
static double phi_range(phi_solver *s, const double *coef)
{
    phi_copy(s->y[0], s->x, s);
    phi_relaxed(s, coef PHI_AND_FULL_RANGE(1), 0);
    return PHI_PLAUSIBLE * phi_distance(s, 1, 1.0);
}


/* Solve the equation of a stage for y to rounding level, starting from s->y[0]; the solution is s->y[*now]. Iterate by
   fixed-point sweeps or, if s->stiff, by Newton's method. Newton's method fails for solutions farther from x than
   `range`. */
static phi_status phi_middle(phi_solver *s, const double *coef PHI_AND_INT_FULL_RANGE, double range, int *now)
{
    double before = 0.0;
    for (int count = 0; count < PHI_MOST_SWEEPS; ++count) {
        const double change = s->stiff ? phi_corrected(s, coef, *now) : phi_relaxed(s, coef PHI_AND_FULL_RANGE(full_range), *now);
        const double shrunk = before - change;
        const phi_status failed = count == 0 && !s->stiff ? PHI_NOT_FINITE : PHI_NO_CONVERGENCE;
        ++s->sweeps;
        *now = 1 - *now;
        if (!isfinite(change)) return failed;
        /* stop at rounding level, or if the sum of all further changes, change^2 / shrunk, is negligible */
        if (change * change <= shrunk * PHI_SETTLED || (shrunk <= 0.0 && change <= PHI_ROUNDING && count > 0))
            return (s->stiff ? phi_distance(s, *now, 0.0) <= range : phi_all_hold(s, s->y[*now])) ? PHI_OK : failed;
        if (!s->stiff && count >= PHI_PATIENCE && change > PHI_SLOW * before && change > PHI_NEARLY_SETTLED) break;
#if PHI_BANDED
        if (count > 0 && change > 0.25 * before && change > PHI_ROUNDING) s->factored = NULL;
#endif
        before = change;
    }
    return PHI_NO_CONVERGENCE;
}
#include "lattice_newton_tangent.c"
#endif
