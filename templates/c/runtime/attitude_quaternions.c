#ifndef PHI_FILE_ATTITUDE_QUATERNIONS
#define PHI_FILE_ATTITUDE_QUATERNIONS
#include <float.h>
#include <math.h>
#include <string.h>
#include "model.h"

#include "attitude_position.c"
#include "attitude_velocity_first.c"
#include "attitude_velocity_last.c"

/* Compute the product of two quaternions. */
static inline void phi_group_product(const double a[4], const double b[4], double product[4])
{
    product[0] = (a[0] * b[0] - a[1] * b[1]) - (a[2] * b[2] + a[3] * b[3]);
    product[1] = (a[0] * b[1] + a[1] * b[0]) + (a[2] * b[3] - a[3] * b[2]);
    product[2] = (a[0] * b[2] + a[2] * b[0]) + (a[3] * b[1] - a[1] * b[3]);
    product[3] = (a[0] * b[3] + a[3] * b[0]) + (a[1] * b[2] - a[2] * b[1]);
}

/* Compute the change of the vector v when it is rotated by the quaternion q. */
static void phi_rotation(const double q[4], const double v[3], double change[3])
{
    const double x = q[2] * v[2] - q[3] * v[1], y = q[3] * v[0] - q[1] * v[2], z = q[1] * v[1] - q[2] * v[0];
    change[0] = 2.0 * (q[0] * x + (q[2] * z - q[3] * y));
    change[1] = 2.0 * (q[0] * y + (q[3] * x - q[1] * z));
    change[2] = 2.0 * (q[0] * z + (q[1] * y - q[2] * x));
}

/* Compute the change of a group element when it is multiplied by 1 + factor from the left. */
static inline void phi_added_left(const double element[PHI_ELEMENT], const double factor[PHI_ELEMENT],
    double change[PHI_ELEMENT])
{
    const double q[4] = { 1.0 + factor[0], factor[1], factor[2], factor[3] };
    phi_group_product(factor, element, change);
    phi_rotation(q, element + 4, change + 4);
    for (int i = 4; i < 7; ++i) change[i] += factor[i];
}

/* Compute the change of a group element when it is multiplied by 1 + factor from the right. */
static inline void phi_added_right(const double element[PHI_ELEMENT], const double factor[PHI_ELEMENT],
    double change[PHI_ELEMENT])
{
    phi_group_product(element, factor, change);
    phi_rotation(element, factor + 4, change + 4);
    for (int i = 4; i < 7; ++i) change[i] += factor[i];
}

/* Compute the group element of a motion for the time t with a constant rate; `element` is its difference from the
   identity. */
static void phi_uniform(const double rate[PHI_RATE], double t, double element[PHI_ELEMENT])
{
    const double speed = sqrt(rate[0] * rate[0] + (rate[1] * rate[1] + rate[2] * rate[2])), quarter = 0.25 * (t * speed);
    const double sine = sin(quarter), scale = speed > 0.0 ? 2.0 * (sine * cos(quarter)) / speed : 0.0;
    element[0] = -2.0 * (sine * sine);
    for (int i = 0; i < 3; ++i) element[i + 1] = scale * rate[i];
    phi_uniform_position(rate, t, speed, scale, element);
}

/* Rotate the rate of the gauge rotation into the frame where momenta are constant. `element` is the attitude as a group
   element. */
static void phi_carry_rate(const double element[PHI_ELEMENT], double rate[PHI_RATE])
{
    double change[3];
    PHI_INTO_CONSTANT_FRAME(q, element)
    phi_leave_position(element, rate);
    for (int k = 0; k < PHI_RATE; k += 3) {
        phi_rotation(q, rate + k, change);
        for (int i = 0; i < 3; ++i) rate[k + i] += change[i];
    }
    phi_reach_position(element, rate);
}

/* Squared length of a quaternion minus 1. Its rounding errors have no preferred sign and do not accumulate. */
static inline double phi_excess(const double q[4])
{
    return ((q[0] * q[0] - 1.0) + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3]);
}

#include "attitude_direction.c"
#include "attitude_length.c"

/* Add the identity, the quaternion 1, to a group element. */
static inline void phi_add_identity(double element[PHI_ELEMENT]) { element[0] += 1.0; }

/* Set the group element of the attitude. */
static void phi_take_element(phi_solver *s, const double first[PHI_ELEMENT]) { memcpy(s->turned, first, sizeof s->turned); }

/* Update s->attitude, which users read. */
static void phi_read_attitude(phi_solver *s)
{
    memcpy(s->attitude, s->turned, sizeof s->attitude);
    phi_read_position(s);
}

/* Divide a quaternion by its length, unless the length is 1 to round-off. `size` is the magnitude of its largest
   component. */
static void phi_make_unit(double quaternion[PHI_ELEMENT], double size)
{
    double square = 0.0;
    for (int i = 0; i < 4; ++i) square += quaternion[i] * quaternion[i];
    if (fabs(square - 1.0) <= 4.0 * DBL_EPSILON) return;
    square = 0.0;
    for (int i = 0; i < 4; ++i) {
        quaternion[i] /= size;
        square += quaternion[i] * quaternion[i];
    }
    for (int i = 0; i < 4; ++i) quaternion[i] /= sqrt(square);
}
#endif
