#ifndef PHI_FILE_GAUSS_LIFTED
#define PHI_FILE_GAUSS_LIFTED
#include <float.h>
#include <math.h>
#include <string.h>

/* ---- Frames of group elements ---- */
/* Some unknowns are components of quaternions F ("frames"), with F* k F = y: k is the unit quaternion, y a vector that
   is linear in x. A step adds a change to F. Compute the first F: |y|^1/2 times the rotation of y to k or -k, whichever
   is nearer. */
static void phi_lift_one(const double y[3], double f[4])
{
    const double length = sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2]), half = sqrt(0.5 * (length + fabs(y[2])));
    const double a = half > 0.0 ? 0.5 * y[0] / half : 0.0, b = half > 0.0 ? 0.5 * y[1] / half : 0.0;
    f[0] = y[2] >= 0.0 ? half : b;
    f[1] = y[2] >= 0.0 ? b : half;
    f[2] = y[2] >= 0.0 ? -a : 0.0;
    f[3] = y[2] >= 0.0 ? 0.0 : a;
}

/* Multiply the frame f by the rotation exp(t k) that brings it nearest to an old frame, so that old increments can
   still predict the next step. */
static void phi_align(const double old[4], double f[4])
{
    const double a = f[0] * old[0] + f[1] * old[1] + f[2] * old[2] + f[3] * old[3];
    const double d = f[3] * old[0] - f[0] * old[3] + f[2] * old[1] - f[1] * old[2], size = sqrt(a * a + d * d);
    const double c = size > 0.0 ? a / size : 1.0, s = size > 0.0 ? -d / size : 0.0;
    const double turned[4] = { c * f[0] - s * f[3], c * f[1] - s * f[2], c * f[2] + s * f[1], c * f[3] + s * f[0] };
    memcpy(f, turned, sizeof turned);
}

/* Compute the frames of the present state, unless those from the last step are still valid. */
static void phi_lift(phi_solver *s)
{
    phi_history *past = &s->history;
    double values[3 * PHI_COPIES], f[4], old[4];
    if (past->lifted && !past->kicked) return;
    phi_functionals(s->coef, s->x, values);
    for (int copy = 0; copy < PHI_COPIES; ++copy) {
        const int *places = phi_copies[copy];
        phi_lift_one(values + 3 * copy, f);
        for (int i = 0; i < 4; ++i) old[i] = past->frame[places[i]];
        if (past->lifted) phi_align(old, f);
        for (int i = 0; i < 4; ++i) past->frame[places[i]] = f[i];
    }
    memset(past->frame_carry, 0, sizeof past->frame_carry);
    past->lifted = 1;
}

/* Weight of squared changes of frames F: 1 / |F|^2, bounded so that its ratio to the weight of coordinates does not
   underflow. */
static double phi_element_scale(const phi_solver *s)
{
    double square = sqrt(DBL_MIN);
    for (int i = 0; i < PHI_LIFT; ++i) square += s->history.frame[i] * s->history.frame[i];
    return 1.0 / square;
}

/* Replace the frames by those at the end of a step, in compensated arithmetic; `end` are the changes of the unknowns.
   */
static void phi_move_frames(phi_solver *s, const double end[PHI_UNKNOWNS])
{
    for (int i = 0; i < PHI_LIFT; ++i) {
        const double before = s->history.frame[i], change = end[PHI_UNKNOWNS - PHI_LIFT + i] + s->history.frame_carry[i];
        s->history.frame[i] = before + change;
        s->history.frame_carry[i] = change - (s->history.frame[i] - before);
    }
}
#endif
