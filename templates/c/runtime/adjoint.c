#ifndef PHI_FILE_ADJOINT
#define PHI_FILE_ADJOINT
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
    double coef[PHI_STAGES][PHI_COEFFICIENTS];
} phi_cotangent;

#if PHI_PATH
#define PHI_BACK_NEGLIGIBLE 1e-18    /* terms that rounding hides in their sum, in sizes of start and sum */
#define PHI_BACK_ROUNDED_SLOPE 1e-13 /* rounding of slopes, in sizes of the path and its slope */

/* The sizes of the groups of what is traced back: the state, its cotangent, and those of p and of coefficients. */
static void phi_back_sizes(const double values[PHI_BACK], double sizes[4])
{
    for (int g = 0; g < 4; ++g) sizes[g] = 0.0;
    for (int i = 0; i < PHI_BACK; ++i) sizes[i < 3 * PHI_DIM ? i / PHI_DIM : 3] += fabs(values[i]);
}

/* Whether a path that is traced back satisfies its equation at m, where its expansion has the given slope. */
static int phi_back_holds(const double *coef, const double p[PHI_BACK], const double m[PHI_BACK],
    const double slope[PHI_BACK])
{
    double field[PHI_BACK], of_m[4], of_slope[4];
    phi_back_field(coef, p, m, field);
    phi_back_sizes(m, of_m);
    phi_back_sizes(slope, of_slope);
    for (int i = 0; i < PHI_BACK; ++i) {
        const int g = i < 3 * PHI_DIM ? i / PHI_DIM : 3;
        if (!(fabs(field[i] - slope[i]) <= PHI_BACK_ROUNDED_SLOPE * (of_m[g] + of_slope[g]) + DBL_MIN)) return 0;
    }
    return 1;
}

/* A path that is traced back with its cotangents, 0 <= t <= 1, by their Taylor series: change is the end minus the start.
   0 if PHI_TERMS terms do not suffice. */
static int phi_back_piece(const double *coef, const double p[PHI_BACK], const double start[PHI_BACK],
    double change[PHI_BACK])
{
    double series[PHI_BACK_SERIES][PHI_TERMS + 1], fixed[PHI_BACK_FIXED], end[PHI_BACK], slope[PHI_BACK];
    double of_start[4], of_change[4];
    int small = 0;
    for (int i = 0; i < PHI_BACK; ++i) {
        series[i][0] = start[i];
        change[i] = slope[i] = 0.0;
    }
    phi_back_sizes(start, of_start);
    phi_back_begin(coef, p, series, fixed);
    for (int k = 0; k < PHI_TERMS; ++k) {
        phi_back_order(coef, p, series, fixed, k);
        for (int i = 0; i < PHI_BACK; ++i) {
            const double term = series[i][k + 1];
            change[i] += term;
            slope[i] += (k + 1) * term;
            end[i] = start[i] + change[i];
        }
        int negligible = 1;
        phi_back_sizes(change, of_change);
        for (int i = 0; i < PHI_BACK; ++i) {
            const int g = i < 3 * PHI_DIM ? i / PHI_DIM : 3;
            const double size = of_start[g] + of_change[g];
            if (!(fabs(series[i][k + 1]) <= PHI_BACK_NEGLIGIBLE * size + DBL_MIN)) negligible = 0;
        }
        small = negligible ? small + 1 : 0;
        if (small >= 2 && phi_back_holds(coef, p, end, slope)) return 1;
    }
    return 0;
}

/* The cotangents of the start of a path, of p and of the coefficients that it depends on (found, after the state), from
   those of its end and of its mean. 0 if it cannot be followed. */
static int phi_traced_back(const double *coef, const double end[PHI_DIM], const double p[PHI_DIM],
    const double bar[PHI_DIM], const double mean_bar[PHI_DIM], double found[PHI_BACK])
{
    for (int pieces = 1; pieces <= PHI_LONGEST_PATH; pieces *= 2) {
        double given[PHI_BACK] = { 0.0 }, change[PHI_BACK];
        int good = 1;
        for (int i = 0; i < PHI_BACK; ++i) found[i] = 0.0;
        for (int i = 0; i < PHI_DIM; ++i) {
            given[i] = p[i] / pieces;
            given[PHI_DIM + i] = mean_bar[i] / pieces;
            found[i] = end[i];
            found[PHI_DIM + i] = bar[i];
        }
        for (int piece = 0; piece < pieces && good; ++piece) {
            good = phi_back_piece(coef, given, found, change);
            for (int i = 0; i < PHI_BACK; ++i) found[i] += i / PHI_DIM == 2 ? change[i] / pieces : change[i];
        }
        if (good) return 1;
    }
    return 0;
}

/* Pull a cotangent back through a stage that ended at end, and whose path had the mean y. With p = grad S_h(y) the
   cotangent w of p is b + B H w: b is what the path gives for that of its end, B for those of its mean, and H the
   Hessian of S_h. */
static phi_status phi_stage_adjoint(const double *coef, double trail[PHI_PARTS_OF_TRAIL][PHI_DIM], double bar[PHI_DIM],
    double coef_bar[PHI_COEFFICIENTS])
{
    double p[PHI_DIM], hessian[PHI_DIM * PHI_DIM], matrix[PHI_DIM * PHI_DIM], covector[PHI_DIM], mean_bar[PHI_DIM], found[PHI_BACK];
    double columns[PHI_DIM][PHI_DIM], slopes[PHI_COEFFICIENTS];
    const double *y = trail[0], *end = trail[1], zero[PHI_DIM] = { 0.0 };
    phi_curvature(coef, y, p, hessian);
    for (int j = 0; j < PHI_DIM; ++j) {
        double unit[PHI_DIM] = { 0.0 };
        unit[j] = 1.0;
        if (!phi_traced_back(coef, end, p, zero, unit, found)) return PHI_NO_CONVERGENCE;
        memcpy(columns[j], found + 2 * PHI_DIM, sizeof columns[j]);
    }
    for (int i = 0; i < PHI_DIM; ++i)
        for (int j = 0; j < PHI_DIM; ++j) {
            double sum = i == j ? 1.0 : 0.0;
            for (int k = 0; k < PHI_DIM; ++k) sum -= columns[k][i] * hessian[j * PHI_DIM + k];
            matrix[i * PHI_DIM + j] = sum;
        }
    if (!phi_traced_back(coef, end, p, bar, zero, found)) return PHI_NO_CONVERGENCE;
    memcpy(covector, found + 2 * PHI_DIM, sizeof covector);
    if (!phi_solve(matrix, covector)) return PHI_SINGULAR;
    for (int i = 0; i < PHI_DIM; ++i) {
        mean_bar[i] = 0.0;
        for (int k = 0; k < PHI_DIM; ++k) mean_bar[i] += hessian[k * PHI_DIM + i] * covector[k];
    }
    if (!phi_traced_back(coef, end, p, bar, mean_bar, found)) return PHI_NO_CONVERGENCE;
    memcpy(bar, found + PHI_DIM, PHI_DIM * sizeof bar[0]);
    phi_slope_adjoint(coef, y, covector, slopes);
    for (int k = 0; k < PHI_COEFFICIENTS; ++k) coef_bar[k] += slopes[k];
    for (int k = 3 * PHI_DIM; k < PHI_BACK; ++k) coef_bar[phi_back_used[k - 3 * PHI_DIM]] += found[k];
    return PHI_OK;
}

#elif PHI_NEWTON
/* Pull a cotangent back through a stage that has solved for y: with Dy = jacobian^-1 the stage is
   1 + increment_jacobian Dy. */
static phi_status phi_stage_adjoint(const double *coef, double trail[PHI_PARTS_OF_TRAIL][PHI_DIM], double bar[PHI_DIM],
    double coef_bar[PHI_COEFFICIENTS])
{
    double displacement[PHI_DIM], increment[PHI_DIM], jacobian[PHI_DIM * PHI_DIM], slope[PHI_DIM * PHI_DIM], transposed[PHI_DIM * PHI_DIM];
    double back[PHI_DIM], minus[PHI_DIM], slopes[PHI_COEFFICIENTS];
    phi_linearise(coef, trail[0], displacement, increment, jacobian, slope);
    for (int i = 0; i < PHI_DIM; ++i) {
        back[i] = 0.0;
        for (int k = 0; k < PHI_DIM; ++k) {
            back[i] += slope[k * PHI_DIM + i] * bar[k];
            transposed[i * PHI_DIM + k] = jacobian[k * PHI_DIM + i];
        }
    }
    if (!phi_solve(transposed, back)) return PHI_SINGULAR;
    for (int i = 0; i < PHI_DIM; ++i) minus[i] = -back[i];
    phi_linearise_adjoint(coef, trail[0], minus, bar, slopes);
    for (int k = 0; k < PHI_COEFFICIENTS; ++k) coef_bar[k] += slopes[k];
    for (int i = 0; i < PHI_DIM; ++i) bar[i] += back[i];
    return PHI_OK;
}

#elif PHI_EXPLICIT
/* Pull a cotangent back through a stage that began at trail[0]. */
static phi_status phi_stage_adjoint(const double *coef, double trail[PHI_PARTS_OF_TRAIL][PHI_DIM], double bar[PHI_DIM],
    double coef_bar[PHI_COEFFICIENTS])
{
    double back[PHI_DIM], slopes[PHI_COEFFICIENTS];
    phi_explicit_adjoint(coef, trail[0], bar, back, slopes);
    for (int k = 0; k < PHI_COEFFICIENTS; ++k) coef_bar[k] += slopes[k];
    for (int i = 0; i < PHI_DIM; ++i) bar[i] += back[i];
    return PHI_OK;
}

#else
/* Pull a cotangent back through a step that began at trail[0]: its flows are followed, then gone through backwards. */
static phi_status phi_stage_adjoint(const double *coef, double trail[PHI_PARTS_OF_TRAIL][PHI_DIM], double bar[PHI_DIM],
    double coef_bar[PHI_COEFFICIENTS])
{
    double x[PHI_FLOWS + 1][PHI_DIM];
    memcpy(x[0], trail[0], sizeof x[0]);
    for (int k = 0; k < PHI_FLOWS; ++k) {
        memcpy(x[k + 1], x[k], sizeof x[k]);
        phi_follow(phi_flow_part[k], coef + phi_flow_row[k] * PHI_ROW, x[k + 1]);
    }
    for (int k = PHI_FLOWS - 1; k >= 0; --k) {
        const int row = phi_flow_row[k] * PHI_ROW;
        phi_follow_back(phi_flow_part[k], coef + row, x[k], bar, coef_bar + row);
    }
    return PHI_OK;
}

#endif
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
/* Pull a cotangent back through the step that led to s, whose trail is given; s goes back in time, but for its state. */
static phi_status phi_back(phi_solver *s, double trail[PHI_STAGES][PHI_PARTS_OF_TRAIL][PHI_DIM], phi_cotangent *bar)
{
    phi_status status = PHI_OK;
    --s->steps;
#if !PHI_MONITOR
    s->t = s->t_before_h + (double)(s->steps - s->steps_before_h) * s->h;
#endif
#if PHI_RENEWED
    phi_renew(s);
#endif
    for (int stage = PHI_STAGES - 1; stage >= 0; --stage)
        if (status == PHI_OK) status = phi_stage_adjoint(s->coef[stage], trail[stage], bar->x, bar->coef[stage]);
#if PHI_RENEWED
#if PHI_SPLITTING
    for (int k = 0; k < PHI_ROWS_OF_FLOWS; ++k)
        phi_early(s->coef[0] + k * PHI_ROW, bar->coef[0] + k * PHI_ROW, s->t + phi_moments[k] * s->h);
#else
    for (int stage = 0; stage < PHI_STAGES; ++stage)
        phi_early(s->coef[stage], bar->coef[stage], s->t + phi_middles[stage] * s->h);
#endif
#endif
    for (int i = 0; i < PHI_DIM; ++i)
        if (!isfinite(bar->x[i]) && status == PHI_OK) status = PHI_NOT_FINITE;
    return status;
}

#if PHI_IMPLICIT
/* The trail of the last steps, from what the solver remembers of them. 0 if it does not remember all. */
static int phi_remembered(const phi_solver *s, size_t steps, double trail[][PHI_STAGES][PHI_PARTS_OF_TRAIL][PHI_DIM])
{
    for (int stage = 0; stage < PHI_STAGES; ++stage) {
        const phi_history *history = &s->history[stage];
#if PHI_RECURRENCES
        const size_t count = (size_t)history->count;
        if (count < steps) return 0;
        for (size_t k = 0; k < steps; ++k) memcpy(trail[k][stage][0], history->past[count - steps + k], sizeof s->x);
#else
        if (steps > 1) return 0;
        memcpy(trail[0][stage][0], history->difference[0], sizeof s->x);
#endif
    }
    return 1;
}

#endif
#if PHI_PATH
/* Complete the trail of steps from x by the end of each path. */
static phi_status phi_ends(const phi_solver *s, const double x[PHI_DIM], size_t steps,
    double trail[][PHI_STAGES][PHI_PARTS_OF_TRAIL][PHI_DIM])
{
    double start[PHI_DIM], p[PHI_DIM], hessian[PHI_DIM * PHI_DIM], change[PHI_DIM], mean[PHI_DIM];
    int made = 0;
    memcpy(start, x, sizeof start);
    for (size_t k = 0; k < steps; ++k) {
        for (int stage = 0; stage < PHI_STAGES; ++stage) {
            phi_curvature(s->coef[stage], trail[k][stage][0], p, hessian);
            if (!phi_path(s->coef[stage], start, p, change, mean, &made)) return PHI_NO_CONVERGENCE;
            for (int i = 0; i < PHI_DIM; ++i) start[i] += change[i];
            memcpy(trail[k][stage][1], start, sizeof start);
        }
    }
    return PHI_OK;
}

#endif
/* Make a few steps, and their trail. */
static phi_status phi_leave_few(phi_solver *s, size_t steps, double trail[][PHI_STAGES][PHI_PARTS_OF_TRAIL][PHI_DIM])
{
    const phi_solver before = *s;
    phi_status status;
#if PHI_IMPLICIT
    status = phi_integrate(s, s->h, steps);
    if (status == PHI_OK && !phi_remembered(s, steps, trail)) { /* a step forgot what was before it */
        *s = before;
        for (size_t k = 0; k < steps && status == PHI_OK; ++k) {
            status = phi_step(s, s->h);
            if (status == PHI_OK && !phi_remembered(s, 1, trail + k)) status = PHI_NO_CONVERGENCE;
        }
    }
#if PHI_PATH
    if (status == PHI_OK) status = phi_ends(s, before.x, steps, trail);
#endif
#else
    status = phi_integrate(s, s->h, steps);
#if PHI_COMPOSED
    double x[PHI_DIM], change[PHI_DIM];
    memcpy(x, before.x, sizeof x);
    for (int stage = 0; stage < PHI_STAGES; ++stage) {
        memcpy(trail[0][stage][0], x, sizeof x);
        phi_explicit(s->coef[stage], x, change);
        for (int i = 0; i < PHI_DIM; ++i) x[i] += change[i];
    }
#else
    memcpy(trail[0], before.x, sizeof before.x);
#endif
#endif
    if (status != PHI_OK) *s = before;
    return status;
}

/* How many steps are recorded at once: those that the solver remembers; of paths, those with the same coefficients. */
#if PHI_RECURRENCES && PHI_NEWTON || PHI_RECURRENCES && !PHI_RENEWED
#define PHI_AT_ONCE ((size_t)PHI_REMEMBERED)
#else
#define PHI_AT_ONCE ((size_t)1)
#endif

/* Make steps, and their trail. Rows, where not NULL, are the states after each stride steps, and at the end. */
static phi_status phi_leave_trail(phi_solver *s, size_t steps, size_t stride, double *rows,
    double trail[][PHI_STAGES][PHI_PARTS_OF_TRAIL][PHI_DIM])
{
    phi_status status = PHI_OK;
    for (size_t done = 0; done < steps && status == PHI_OK;) {
        const size_t until = steps - done < stride - done % stride ? steps - done : stride - done % stride;
        const size_t count = until < PHI_AT_ONCE ? until : PHI_AT_ONCE;
        status = phi_leave_few(s, count, trail + done);
        done += count;
        if (rows != NULL && count == until) {
            memcpy(rows, s->x, sizeof s->x);
            rows += PHI_DIM;
        }
    }
    return status;
}

#if PHI_PARAMETERS || PHI_MONITOR
/* Add the cotangents of parameters that follow from those of coefficients. */
#if PHI_MONITOR
static void phi_add_parameters(const phi_solver *s, const phi_cotangent *bar, phi_params *params_bar, double *e_bar)
#else
static void phi_add_parameters(const phi_solver *s, const phi_cotangent *bar, phi_params *params_bar)
#endif
{
    double found[sizeof(phi_params) / sizeof(double) + 1], sums[sizeof(phi_params) / sizeof(double) + 1] = { 0.0 };
#if PHI_PARAMETERS
    if (params_bar != NULL) memcpy(sums, params_bar, sizeof *params_bar);
#endif
#if PHI_MONITOR
    double level[1];
#endif
#if PHI_SPLITTING
    for (int k = 0; k < PHI_ROWS_OF_FLOWS; ++k) {
        const double *own = bar->coef[0] + k * PHI_ROW;
#if PHI_KICKS
        const double kick[1] = { phi_multiples[k] * (s->h * s->h) };
        phi_prepare_adjoint(&s->params, phi_times[k] * s->h, kick, own, found);
#elif PHI_MONITOR
        phi_prepare_adjoint(&s->params, s->gauge, phi_times[k] * s->h, own, found, level);
#else
        phi_prepare_adjoint(&s->params, phi_times[k] * s->h, own, found);
#endif
#else
    for (int stage = 0; stage < PHI_STAGES; ++stage) {
#if PHI_MONITOR
        phi_prepare_adjoint(&s->params, s->gauge, phi_fractions[stage] * s->h, bar->coef[stage], found, level);
#elif PHI_GAUGE
        phi_prepare_adjoint(&s->params, s->gauge, phi_fractions[stage] * s->h, bar->coef[stage], found);
#else
        phi_prepare_adjoint(&s->params, phi_fractions[stage] * s->h, bar->coef[stage], found);
#endif
#endif
        for (size_t i = 0; i < sizeof(phi_params) / sizeof(double); ++i) sums[i] += found[i];
#if PHI_MONITOR
        if (e_bar != NULL) *e_bar += level[0];
#endif
    }
#if PHI_PARAMETERS
    if (params_bar != NULL) memcpy(params_bar, sums, sizeof *params_bar);
#endif
}

#endif
#if PHI_MONITOR
void phi_level_bar(const phi_params *params, const double x0[PHI_DIM], double e_bar, double x0_bar[PHI_DIM],
    phi_params *params_bar)
{
    double slope[PHI_DIM], found[sizeof(phi_params) / sizeof(double) + 1];
    phi_level_adjoint(params != NULL ? params : &phi_default_params, x0, slope, found);
    for (int i = 0; i < PHI_DIM; ++i) x0_bar[i] -= e_bar * slope[i];
#if PHI_PARAMETERS
    double sums[sizeof(phi_params) / sizeof(double)];
    memcpy(sums, params_bar, sizeof sums);
    for (size_t i = 0; i < sizeof sums / sizeof sums[0]; ++i) sums[i] -= e_bar * found[i];
    memcpy(params_bar, sums, sizeof sums);
#else
    (void)params_bar;
#endif
}

phi_status phi_pullback(phi_solver *s, double h, size_t steps, size_t stride, double *rows, const double *rows_bar,
    double x0_bar[PHI_DIM], phi_params *params_bar, double *e_bar, double *trail)
#else
phi_status phi_pullback(phi_solver *s, double h, size_t steps, size_t stride, double *rows, const double *rows_bar,
    double x0_bar[PHI_DIM], phi_params *params_bar, double *trail)
#endif
{
    if (s == NULL || rows_bar == NULL || x0_bar == NULL || trail == NULL || stride == 0) return PHI_BAD_ARGUMENT;
    const phi_solver before = *s;
    phi_status status = phi_set_step(s, h);
    if (status != PHI_OK) return status;
    double (*kept)[PHI_STAGES][PHI_PARTS_OF_TRAIL][PHI_DIM] = (double (*)[PHI_STAGES][PHI_PARTS_OF_TRAIL][PHI_DIM])trail;
    phi_cotangent bar;
    memset(&bar, 0, sizeof bar);
    status = phi_leave_trail(s, steps, stride, rows, kept);
    if (status == PHI_OK) {
        phi_solver at = *s;
        for (size_t done = steps; done > 0 && status == PHI_OK; --done) {
            if (done == steps || done % stride == 0)
                for (int i = 0; i < PHI_DIM; ++i) bar.x[i] += rows_bar[(done + stride - 1) / stride * PHI_DIM - PHI_DIM + (size_t)i];
            status = phi_back(&at, kept[done - 1], &bar);
        }
    }
    if (status != PHI_OK) {
        *s = before;
        return status;
    }
#if PHI_MONITOR
    phi_add_parameters(s, &bar, params_bar, e_bar);
#elif PHI_PARAMETERS
    phi_add_parameters(s, &bar, params_bar);
#else
    (void)params_bar;
#endif
    memcpy(x0_bar, bar.x, sizeof bar.x);
    return PHI_OK;
}

size_t phi_trail_size(void) { return PHI_TRAIL; }

phi_status phi_step_adjoint(phi_solver *s, double h, const double x1_bar[PHI_DIM], double x0_bar[PHI_DIM],
    phi_params *params_bar)
{
    double trail[PHI_TRAIL];
#if PHI_MONITOR
    return phi_pullback(s, h, 1, 1, NULL, x1_bar, x0_bar, params_bar, NULL, trail);
#else
    return phi_pullback(s, h, 1, 1, NULL, x1_bar, x0_bar, params_bar, trail);
#endif
}
#endif
