/* The model in lanes, by the functions for one point. */
#ifndef MODEL_LANES_H
#define MODEL_LANES_H
#include "lanes.c"
#include "model.h"

enum { PHI_SLOPE_TERMS = PHI_ADJOINT ? 16 : 8, PHI_SLOPE_SERIES = 2, PHI_SLOPE_FIXED = 1, PHI_FACTORS = 1 };

#if PHI_ATTITUDE
static void phi_turn_lanes(phi_lanes coef[], phi_lanes y[2], phi_lanes turn[PHI_TURN])
{
    for (int i = 0; i < PHI_TURN; ++i)
        for (int lane = 0; lane < PHI_LANES; ++lane) turn[i][lane] = 0.0 * coef[0][lane] * y[0][lane];
}

#if PHI_MATRICES
static void phi_exponential_lanes(phi_lanes p[], phi_lanes element[PHI_ELEMENT])
{
    for (int i = 0; i < PHI_ELEMENT; ++i)
        for (int lane = 0; lane < PHI_LANES; ++lane) element[i][lane] = 0.0 * p[0][lane];
}

#endif

#endif
#if PHI_NEWTON
static void phi_linearise_lanes(phi_lanes coef[], phi_lanes y[2], phi_lanes displacement[2], phi_lanes increment[2],
    phi_lanes jacobian[4], phi_lanes slope[4])
{
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        const double c[2] = { coef[0][lane], coef[1][lane] }, point[2] = { y[0][lane], y[1][lane] };
        double d[2], e[2], j[4], k[4];
        phi_linearise(c, point, d, e, j, k);
        for (int i = 0; i < 2; ++i) displacement[i][lane] = d[i], increment[i][lane] = e[i];
        for (int i = 0; i < 4; ++i) jacobian[i][lane] = j[i], slope[i][lane] = k[i];
    }
}

#if PHI_ADJOINT
static void phi_linearise_adjoint_lanes(phi_lanes coef[], phi_lanes y[2], phi_lanes displacement_bar[2],
    phi_lanes increment_bar[2], phi_lanes coef_bar[2])
{
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        const double c[2] = { coef[0][lane], coef[1][lane] }, point[2] = { y[0][lane], y[1][lane] };
        const double d[2] = { displacement_bar[0][lane], displacement_bar[1][lane] };
        const double e[2] = { increment_bar[0][lane], increment_bar[1][lane] };
        double found[2];
        phi_linearise_adjoint(c, point, d, e, found);
        for (int i = 0; i < 2; ++i) coef_bar[i][lane] = found[i];
    }
}

#endif
static void phi_evaluate_lanes(phi_lanes coef[], phi_lanes y[2], phi_lanes displacement[2], phi_lanes increment[2])
{
    phi_lanes jacobian[4], slope[4];
    phi_linearise_lanes(coef, y, displacement, increment, jacobian, slope);
}

#endif
#if PHI_PATH
static void phi_curvature_lanes(phi_lanes coef[], phi_lanes y[2], phi_lanes p[2], phi_lanes hessian[4])
{
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        const double c[2] = { coef[0][lane], coef[1][lane] }, point[2] = { y[0][lane], y[1][lane] };
        double slope[2], entries[4];
        phi_curvature(c, point, slope, entries);
        for (int i = 0; i < 2; ++i) p[i][lane] = slope[i];
        for (int i = 0; i < 4; ++i) hessian[i][lane] = entries[i];
    }
}

static void phi_momentum_lanes(phi_lanes coef[], phi_lanes y[2], phi_lanes p[2])
{
    phi_lanes hessian[4];
    phi_curvature_lanes(coef, y, p, hessian);
}

static void phi_values_lanes(phi_lanes coef[], phi_lanes p[2], phi_lanes m[2], phi_lanes value[4], phi_lanes fixed[1])
{
    (void)coef;
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        value[0][lane] = m[0][lane];
        value[1][lane] = m[1][lane];
        value[2][lane] = p[1][lane];
        value[3][lane] = -p[0][lane];
        fixed[0][lane] = 0.0;
    }
}

static void phi_slope_values_lanes(phi_lanes coef[], phi_lanes p[2], phi_lanes value[4], phi_lanes fixed[1],
    phi_lanes slope[2], phi_lanes slope_fixed[1])
{
    (void)coef, (void)p, (void)value, (void)fixed;
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        slope[0][lane] = 1.0;
        slope[1][lane] = -1.0;
        slope_fixed[0][lane] = 0.0;
    }
}

#if PHI_ADJOINT
static void phi_slope_adjoint_lanes(phi_lanes coef[], phi_lanes y[2], phi_lanes slope_bar[2], phi_lanes coef_bar[2])
{
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        const double c[2] = { coef[0][lane], coef[1][lane] }, point[2] = { y[0][lane], y[1][lane] };
        const double bar[2] = { slope_bar[0][lane], slope_bar[1][lane] };
        double found[2];
        phi_slope_adjoint(c, point, bar, found);
        for (int i = 0; i < 2; ++i) coef_bar[i][lane] = found[i];
    }
}

#endif
/* alpha and beta are y -+ pi p / 2: their derivatives do not need those of the path, which is straight. */
static void phi_along_mean_lanes(phi_lanes even[8], phi_lanes odd[8], phi_lanes mean[8], phi_lanes hessian[4],
    phi_lanes alpha_y[4], phi_lanes increment_y[4], phi_lanes jacobian[4], phi_lanes slope[4], phi_lanes reciprocal[4])
{
    (void)even, (void)odd, (void)mean;
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        const double derivative[4] = { 0.0, hessian[3][lane], -hessian[0][lane], 0.0 };
        for (int i = 0; i < 4; ++i) {
            alpha_y[i][lane] = i % 3 == 0 ? 1.0 : 0.0;
            increment_y[i][lane] = 0.0;
            slope[i][lane] = derivative[i];
            jacobian[i][lane] = alpha_y[i][lane] - 0.5 * derivative[i];
            reciprocal[i][lane] = 1.0;
        }
    }
}

static void phi_invert_lanes(phi_lanes matrix[4], phi_lanes slope[4], phi_lanes inverse[4], phi_lanes gain[4],
    phi_lanes reciprocal[2])
{
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        const double a = matrix[0][lane], b = matrix[1][lane], c = matrix[2][lane], d = matrix[3][lane];
        const double scale = 1.0 / (a * d - b * c);
        const double entries[4] = { d * scale, -b * scale, -c * scale, a * scale };
        for (int i = 0; i < 4; ++i) inverse[i][lane] = entries[i];
        for (int i = 0; i < 4; ++i)
            gain[i][lane] = slope[i - i % 2][lane] * entries[i % 2] + slope[i - i % 2 + 1][lane] * entries[2 + i % 2];
        reciprocal[0][lane] = reciprocal[1][lane] = scale;
    }
}

#endif
#if PHI_EXPLICIT
static void phi_explicit_lanes(phi_lanes coef[], phi_lanes state[2], int own, phi_lanes increment[2])
{
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        const double x[2] = { state[0][lane], state[1][lane] }, c[2] = { coef[0][own * lane], coef[1][own * lane] };
        double change[2];
        phi_explicit(c, x, change);
        for (int i = 0; i < 2; ++i) increment[i][lane] = change[i];
    }
}

#if PHI_ADJOINT
static void phi_explicit_adjoint_lanes(phi_lanes coef[], phi_lanes state[2], phi_lanes increment_bar[2],
    phi_lanes state_bar[2], phi_lanes coef_bar[2])
{
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        const double c[2] = { coef[0][lane], coef[1][lane] }, x[2] = { state[0][lane], state[1][lane] };
        const double bar[2] = { increment_bar[0][lane], increment_bar[1][lane] };
        double back[2], found[2];
        phi_explicit_adjoint(c, x, bar, back, found);
        for (int i = 0; i < 2; ++i) state_bar[i][lane] = back[i], coef_bar[i][lane] = found[i];
    }
}

#endif
#endif
#if PHI_SPLITTING
static void phi_flows_lanes(int row, int own, phi_group *group)
{
    for (int k = 0; k < 3 * group->packs; ++k) {
        phi_pack *at = &group->pack[k / 3];
        phi_lanes change, *coef = group->coef[own * (k / 3)] + row * PHI_ROW;
        const int kick = k % 3 == 1;
        for (int lane = 0; lane < PHI_LANES; ++lane)
            change[lane] = kick ? -coef[PHI_ROW + 1][own * lane] * sin(at->x[0][lane]) : coef[0][own * lane] * at->x[1][lane];
        phi_add_lanes(at->x[kick], at->carry[kick], at->start[kick], change);
    }
}

#endif
#endif
