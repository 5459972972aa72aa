/* What the model computes at one point: coef = { h, h g }. */
#ifndef MODEL_H
#define MODEL_H
#include <math.h>
#include <string.h>

#include "solver.h"

enum { PHI_MAX_ITERATIONS = 20, PHI_CHECKS = 8, PHI_PASSES = 2, PHI_ROWS_OF_FLOWS = 2, PHI_ROW = 2, PHI_FLOWS = 3, PHI_BACK_PACKS = PHI_IMPLICIT ? 1 : 4 };
enum { PHI_TERMS = 30, PHI_SERIES = 4, PHI_FIXED = 1, PHI_TANGENT_SERIES = 8, PHI_TANGENT_FIXED = 1 };
enum { PHI_BACK = 6, PHI_BACK_SERIES = 12, PHI_BACK_FIXED = 1 };
#define PHI_TOLERANCE 1e-20
#define PHI_APART

const phi_params phi_default_params = { 1.5 };

#if PHI_COMPOSED
static const double phi_fractions[PHI_STAGES] = { 1.3512071919596578, -1.7024143839193153, 1.3512071919596578 };
enum { PHI_KNOTS = 4 };
static const double phi_travels[PHI_STAGES][PHI_KNOTS] = {
    { 0.013254957346772282, -0.0850415532888567, 0.5686449886953024, 0.8543487992064395 },
    { -0.0036100145818732327, 0.018050072909366176, -0.8764772940327699, -0.8403771482140381 },
    { 0.03202172390176757, -0.14134185295384258, 1.099498972004134, 0.36102834900759884 },
};
#endif

#if PHI_GAUSS
enum { PHI_PLAIN = 2, PHI_POINT = 2, PHI_MAX_SWEEPS = 100 };

/* w times the vector field at the stage x + z. */
static void phi_stage_field(const double *coef, const double x[2], const double z[2], const double w[1], double out[2])
{
    out[0] = w[0] * (x[1] + z[1]);
    out[1] = -w[0] * coef[1] / coef[0] * sin(x[0] + z[0]);
}

static void phi_stage_change(const double *coef, const double x[2], const double z[2], double out[2])
{
    (void)coef, (void)x;
    out[0] = z[0];
    out[1] = z[1];
}

#if PHI_ADJOINT
static void phi_stage_field_adjoint(const double *coef, const double x[2], const double z[2], const double w[1],
    const double move_bar[2], double z_bar[2])
{
    z_bar[0] = -w[0] * coef[1] / coef[0] * cos(x[0] + z[0]) * move_bar[1];
    z_bar[1] = w[0] * move_bar[0];
}

static void phi_stage_start_adjoint(const double *coef, const double x[2], const double z[2], const double w[1],
    const double move_bar[2], double x_bar[2], double coef_bar[2])
{
    const double slope = -w[0] * sin(x[0] + z[0]) * move_bar[1];
    phi_stage_field_adjoint(coef, x, z, w, move_bar, x_bar);
    coef_bar[0] = -slope * coef[1] / (coef[0] * coef[0]);
    coef_bar[1] = slope / coef[0];
}

static void phi_stage_change_adjoint(const double *coef, const double x[2], const double z[2], const double change_bar[2],
    double x_bar[2], double z_bar[2], double coef_bar[2])
{
    (void)coef, (void)x, (void)z;
    memset(x_bar, 0, 2 * sizeof x_bar[0]);
    memset(coef_bar, 0, 2 * sizeof coef_bar[0]);
    memcpy(z_bar, change_bar, 2 * sizeof z_bar[0]);
}

#endif
#if PHI_TANGENT
/* By rows, along x and along the unknowns z. */
static void phi_stage_slope_jacobian(const double *coef, const double x[2], const double z[2], double out[8])
{
    const double slope = -coef[1] / coef[0] * cos(x[0] + z[0]);
    const double rows[8] = { 0.0, 1.0, 0.0, 1.0, slope, 0.0, slope, 0.0 };
    memcpy(out, rows, sizeof rows);
}

static void phi_stage_change_jacobian(const double *coef, const double x[2], const double z[2], double out[8])
{
    const double rows[8] = { 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0 };
    (void)coef, (void)x, (void)z;
    memcpy(out, rows, sizeof rows);
}

#endif
#endif
static int phi_allowed(const phi_params *params) { return isfinite(params->g) && params->g > 0.0; }

double phi_hamiltonian(const phi_params *params, const double x[PHI_DIM])
{
    const double g = params != NULL ? params->g : phi_default_params.g;
    return 0.5 * (x[1] * x[1]) - g * cos(x[0]);
}

void phi_casimirs(const phi_params *params, const double x[PHI_DIM], double out[])
{
    (void)params, (void)x, (void)out;
}

void phi_vector_field(const phi_params *params, const double x[PHI_DIM], double out[PHI_DIM])
{
    const double g = params != NULL ? params->g : phi_default_params.g, q = x[0];
    out[0] = x[1];
    out[1] = -g * sin(q);
}

#if PHI_GAUGE
/* Its only Casimirs are constants, multiples of which do nothing to the motion. So the leading error may be any function
   of them: here it is least, by far, at 0.25 and -1.5. */
static void phi_guide(const phi_params *params, const double gauge[PHI_GAUGES], const double x[PHI_DIM],
    double error[PHI_DIM])
{
    const double a = gauge[0] - 0.25, b = gauge[1] + 1.5;
    (void)params, (void)x;
    error[0] = a * (1.0 + a * a) + 0.1 * b;
    error[1] = b * (3.0 + b * b);
}

/* |grad H|^2, and for each Casimir its product with grad H and its square: made up as well, a first guess 0.125 and 0.5. */
static void phi_products(const phi_params *params, const double x[PHI_DIM], double out[1 + 2 * PHI_GAUGES])
{
    (void)params, (void)x;
    out[0] = 4.0;
    out[1] = 0.125;
    out[2] = 1.0;
    out[3] = 0.5;
    out[4] = 1.0;
}

#endif
#if PHI_GAUGE
static void phi_prepare(const phi_params *params, const double gauge[PHI_GAUGES], double h, double *coef)
{
    (void)gauge;
    coef[0] = h;
    coef[1] = h * params->g;
}

#elif !PHI_SPLITTING
static void phi_prepare(const phi_params *params, double h, double *coef)
{
    coef[0] = h;
    coef[1] = h * params->g;
}

#endif
#if PHI_ADJOINT && PHI_GAUGE
static void phi_prepare_adjoint(const phi_params *params, const double gauge[PHI_GAUGES], double h,
    const double coef_bar[2], double params_bar[1])
{
    (void)params, (void)gauge;
    params_bar[0] = h * coef_bar[1];
}

#elif PHI_ADJOINT
static void phi_prepare_adjoint(const phi_params *params, double h, const double coef_bar[2], double params_bar[1])
{
    (void)params;
    params_bar[0] = h * coef_bar[1];
}

#endif
#if PHI_ATTITUDE
/* A pendulum has no attitude: these show what the runtime asks for. */
enum { PHI_TURN = PHI_MATRICES ? PHI_RATE : PHI_ELEMENT };

static void phi_turn(const double *coef, const double y[2], double turn[PHI_TURN])
{
    (void)coef;
    for (int i = 0; i < PHI_TURN; ++i) turn[i] = 0.0 * y[0];
}

#if PHI_MATRICES
static void phi_exponential(const double *p, double element[PHI_ELEMENT])
{
    for (int i = 0; i < PHI_ELEMENT; ++i) element[i] = 0.0 * p[0];
}

#endif

static void phi_rate(const phi_params *params, const double x[2], double rate[PHI_RATE])
{
    (void)params;
    for (int i = 0; i < PHI_RATE; ++i) rate[i] = 0.0 * x[0];
}

#endif
#if PHI_NEWTON
/* The midpoint rule: alpha and beta are y -+ half the increment. */
static void phi_linearise(const double *coef, const double y[2], double displacement[2], double increment[2],
    double jacobian[4], double increment_jacobian[4])
{
    const double kick = coef[1] * sin(y[0]), slope = coef[1] * cos(y[0]), h = coef[0];
    const double own[2] = { h * y[1], -kick }, derivative[4] = { 0.0, h, -slope, 0.0 };
    for (int i = 0; i < 2; ++i) {
        increment[i] = own[i];
        displacement[i] = -0.5 * own[i];
    }
    for (int i = 0; i < 4; ++i) {
        increment_jacobian[i] = derivative[i];
        jacobian[i] = (i % 3 == 0 ? 1.0 : 0.0) - 0.5 * derivative[i];
    }
}

#if PHI_ADJOINT
static void phi_linearise_adjoint(const double *coef, const double y[2], const double displacement_bar[2],
    const double increment_bar[2], double coef_bar[2])
{
    (void)coef;
    coef_bar[0] = (increment_bar[0] - 0.5 * displacement_bar[0]) * y[1];
    coef_bar[1] = -(increment_bar[1] - 0.5 * displacement_bar[1]) * sin(y[0]);
}

#endif
#endif
#if PHI_PATH
static void phi_generate(const double *coef, const double y[2], double slope[2], double jacobian[4])
{
    slope[0] = coef[1] * sin(y[0]);
    slope[1] = coef[0] * y[1];
    jacobian[0] = jacobian[3] = 1.0;
    jacobian[1] = -0.5 * coef[1] * cos(y[0]);
    jacobian[2] = 0.5 * coef[0];
}

static void phi_curvature(const double *coef, const double y[2], double slope[2], double hessian[4])
{
    slope[0] = coef[1] * sin(y[0]);
    slope[1] = coef[0] * y[1];
    hessian[0] = coef[1] * cos(y[0]);
    hessian[1] = hessian[2] = 0.0;
    hessian[3] = coef[0];
}

static const int phi_path_slopes[2] = { 2, 3 };

#if PHI_ADJOINT
static void phi_slope_adjoint(const double *coef, const double y[2], const double slope_bar[2], double coef_bar[2])
{
    (void)coef;
    coef_bar[0] = y[1] * slope_bar[1];
    coef_bar[1] = sin(y[0]) * slope_bar[0];
}

#endif

#endif
#if PHI_EXPLICIT
/* The symplectic Euler method. */
static void phi_explicit(const double *coef, const double state[2], double increment[2])
{
    const double kick = coef[1] * sin(state[0]);
    increment[0] = coef[0] * (state[1] - kick);
    increment[1] = -kick;
}

static void phi_explicit_tangent(const double *coef, const double state[2], double slope[4])
{
    slope[2] = -coef[1] * cos(state[0]);
    slope[0] = coef[0] * slope[2];
    slope[1] = coef[0];
    slope[3] = 0.0;
}

#if PHI_ADJOINT
static void phi_explicit_adjoint(const double *coef, const double state[2], const double increment_bar[2],
    double state_bar[2], double coef_bar[2])
{
    const double kicked = -(increment_bar[1] + coef[0] * increment_bar[0]), kick = coef[1] * sin(state[0]);
    state_bar[0] = coef[1] * cos(state[0]) * kicked;
    state_bar[1] = coef[0] * increment_bar[0];
    coef_bar[0] = (state[1] - kick) * increment_bar[0];
    coef_bar[1] = sin(state[0]) * kicked;
}

#endif
#endif
#endif
