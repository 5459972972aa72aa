#ifndef PHI_FILE_ATTITUDE_QUATERNIONS
#define PHI_FILE_ATTITUDE_QUATERNIONS
#include <math.h>
#include <string.h>
#include "model.h"

/* The product of two quaternions. */
static inline void phi_group_product(const double a[4], const double b[4], double product[4])
{
    product[0] = (a[0] * b[0] - a[1] * b[1]) - (a[2] * b[2] + a[3] * b[3]);
    product[1] = (a[0] * b[1] + a[1] * b[0]) + (a[2] * b[3] - a[3] * b[2]);
    product[2] = (a[0] * b[2] + a[2] * b[0]) + (a[3] * b[1] - a[1] * b[3]);
    product[3] = (a[0] * b[3] + a[3] * b[0]) + (a[1] * b[2] - a[2] * b[1]);
}

/* What rotating a vector by a quaternion adds to it. */
static void phi_rotation(const double q[4], const double v[3], double change[3])
{
    const double x = q[2] * v[2] - q[3] * v[1], y = q[3] * v[0] - q[1] * v[2], z = q[1] * v[1] - q[2] * v[0];
    change[0] = 2.0 * (q[0] * x + (q[2] * z - q[3] * y));
    change[1] = 2.0 * (q[0] * y + (q[3] * x - q[1] * z));
    change[2] = 2.0 * (q[0] * z + (q[1] * y - q[2] * x));
}

/* What a factor from the left adds to an element. The quaternion of the factor is given less 1. */
static inline void phi_added_left(const double element[PHI_ELEMENT], const double factor[PHI_ELEMENT],
    double change[PHI_ELEMENT])
{
    const double q[4] = { 1.0 + factor[0], factor[1], factor[2], factor[3] };
    phi_group_product(factor, element, change);
    phi_rotation(q, element + 4, change + 4);
    for (int i = 4; i < 7; ++i) change[i] += factor[i];
}

/* What a factor from the right adds to an element. The quaternion of the factor is given less 1. */
static inline void phi_added_right(const double element[PHI_ELEMENT], const double factor[PHI_ELEMENT],
    double change[PHI_ELEMENT])
{
    phi_group_product(element, factor, change);
    phi_rotation(element, factor + 4, change + 4);
    for (int i = 4; i < 7; ++i) change[i] += factor[i];
}

/* The element, less 1, of the motion with a constant rate, for some time. */
static void phi_uniform(const double rate[PHI_RATE], double t, double element[PHI_ELEMENT])
{
    const double speed = sqrt(rate[0] * rate[0] + (rate[1] * rate[1] + rate[2] * rate[2])), quarter = 0.25 * (t * speed);
    const double sine = sin(quarter), scale = speed > 0.0 ? 2.0 * (sine * cos(quarter)) / speed : 0.0;
    element[0] = -2.0 * (sine * sine);
    for (int i = 0; i < 3; ++i) element[i + 1] = scale * rate[i];
#if PHI_POSITION
    const double *w = rate, *v = rate + 3, reach = speed > 0.0 ? 2.0 * (scale * (1.0 + element[0])) : t;
    const double versine = 2.0 * (scale * scale), along = (w[0] * v[0] + w[1] * v[1]) + w[2] * v[2];
    const double rest = speed > 0.0 ? (t - reach) / (speed * speed) * along : 0.0;
    element[4] = reach * v[0] + versine * (w[1] * v[2] - w[2] * v[1]) + rest * w[0];
    element[5] = reach * v[1] + versine * (w[2] * v[0] - w[0] * v[2]) + rest * w[1];
    element[6] = reach * v[2] + versine * (w[0] * v[1] - w[1] * v[0]) + rest * w[2];
#endif
}

/* Take a rate to the frame where momenta are constant, by the element of the attitude. */
static void phi_carry_rate(const double element[PHI_ELEMENT], double rate[PHI_RATE])
{
    double change[3];
#if PHI_SPATIAL
    const double q[4] = { element[0], -element[1], -element[2], -element[3] };
#if PHI_POSITION
    const double *p = element + 4, *w = rate;
    rate[3] -= p[1] * w[2] - p[2] * w[1];
    rate[4] -= p[2] * w[0] - p[0] * w[2];
    rate[5] -= p[0] * w[1] - p[1] * w[0];
#endif
#else
    const double *q = element;
#endif
    for (int k = 0; k < PHI_RATE; k += 3) {
        phi_rotation(q, rate + k, change);
        for (int i = 0; i < 3; ++i) rate[k + i] += change[i];
    }
#if PHI_POSITION && !PHI_SPATIAL
    const double *p = element + 4, *w = rate;
    rate[3] += p[1] * w[2] - p[2] * w[1];
    rate[4] += p[2] * w[0] - p[0] * w[2];
    rate[5] += p[0] * w[1] - p[1] * w[0];
#endif
}

/* By how much the square of the length of a quaternion is more than 1. What rounding leaves of that has no direction, and does
   not add up. */
static inline double phi_excess(const double q[4])
{
    return ((q[0] * q[0] - 1.0) + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3]);
}

#if PHI_LENGTHENED
/* Make a factor, given less 1, of which only the direction matters, one by which the length of q becomes 1. */
static inline void phi_normalise(const double q[4], double factor[4])
{
    const double own = (factor[0] * (2.0 + factor[0]) + factor[1] * factor[1])
        + (factor[2] * factor[2] + factor[3] * factor[3]);
    const double excess = own + phi_excess(q) * (1.0 + own), length = sqrt(1.0 + excess), per = 1.0 / length;
    factor[0] = per * (factor[0] - excess / (1.0 + length));
    for (int i = 1; i < 4; ++i) factor[i] *= per;
}
#else
/* Make a factor, given less 1, one by which the length of q comes nearer to 1. */
static inline void phi_normalise(const double q[4], double factor[4])
{
    const double half = 0.5 * phi_excess(q);
    factor[0] -= half + half * factor[0];
    for (int i = 1; i < 4; ++i) factor[i] -= half * factor[i];
}
#endif
#endif
