#ifndef PHI_FILE_ATTITUDE
#define PHI_FILE_ATTITUDE
#include <float.h>
#include <math.h>
#include <string.h>

#include "model.h"

/* ---- Attitude ---- */
#if PHI_MATRICES
/* The product of two square matrices. */
static void phi_matrix_product(const double a[PHI_ELEMENT], const double b[PHI_ELEMENT], double product[PHI_ELEMENT])
{
    enum { N = PHI_ROWS_OF_ATTITUDE };
    for (int i = 0; i < N; ++i)
        for (int j = 0; j < N; ++j) {
            double sum = 0.0;
            for (int k = 0; k < N; ++k) sum += a[i * N + k] * b[k * N + j];
            product[i * N + j] = sum;
        }
}

#if PHI_NORMALISE
/* Bring a matrix that is nearly orthogonal nearer to that: G (G^T G - 1)/2 is taken from it. */
static void phi_normalise(const double g[PHI_ELEMENT], double carry[PHI_ELEMENT])
{
    enum { N = PHI_ROWS_OF_ATTITUDE };
    double excess[PHI_ELEMENT];
    for (int i = 0; i < N; ++i)
        for (int j = 0; j < N; ++j) {
            double sum = i == j ? -1.0 : 0.0;
            for (int k = 0; k < N; ++k) sum += g[k * N + i] * g[k * N + j];
            excess[i * N + j] = 0.5 * sum;
        }
    for (int i = 0; i < N; ++i)
        for (int j = 0; j < N; ++j)
            for (int k = 0; k < N; ++k) carry[i * N + j] -= g[i * N + k] * excess[k * N + j];
}

#endif
#if PHI_EXPONENTIAL
enum { PHI_SIZE = PHI_COVECTOR - 1 }; /* where a covector tells a bound for the square of its size */

/* By how many halvings P becomes so small that its exponential is a short sum. */
static int phi_doublings(double square)
{
    int doublings = 0;
    for (; isfinite(square) && square > 0.25; square *= 0.25) ++doublings;
    return doublings;
}

/* exp(P) - 1: that of P/2^k, doubled k times. */
#if PHI_NORMALISE
/* Rounding doubles as well: what it takes from orthogonality is put back each time. */
#endif
static void phi_matrix_exponential(const double p[PHI_COVECTOR], double element[PHI_ELEMENT])
{
    double small[PHI_COVECTOR], square[PHI_ELEMENT];
    int doublings = phi_doublings(p[PHI_SIZE]);
    if (doublings == 0) {
        phi_exponential(p, element);
        return;
    }
    for (int i = 0; i < PHI_COVECTOR; ++i) small[i] = ldexp(p[i], -doublings);
    phi_exponential(small, element);
    for (; doublings > 0; --doublings) {
        phi_matrix_product(element, element, square);
        for (int i = 0; i < PHI_ELEMENT; ++i) element[i] = 2.0 * element[i] + square[i];
#if PHI_NORMALISE
        memcpy(square, element, sizeof square);
        for (int i = 0; i < PHI_ELEMENT; i += PHI_ROWS_OF_ATTITUDE + 1) square[i] += 1.0;
        phi_normalise(square, element);
#endif
    }
}

#endif
/* The product of two elements. */
static void phi_product(const double a[PHI_ELEMENT], const double b[PHI_ELEMENT], double product[PHI_ELEMENT])
{
    phi_matrix_product(a, b, product);
}

#if PHI_RATE_OF_GAUGE
/* The element of the motion with a constant rate, for some time. */
static void phi_uniform(const double rate[PHI_RATE], double t, double element[PHI_ELEMENT])
{
    double p[PHI_RATE];
    for (int i = 0; i < PHI_SIZE; ++i) p[i] = t * rate[i];
    p[PHI_SIZE] = t * t * rate[PHI_SIZE];
    phi_matrix_exponential(p, element);
    for (int i = 0; i < PHI_ELEMENT; i += PHI_ROWS_OF_ATTITUDE + 1) element[i] += 1.0;
}

#endif
/* What a factor, given less 1, adds to an element. */
static void phi_added(const double element[PHI_ELEMENT], const double turn[PHI_ELEMENT], double change[PHI_ELEMENT])
{
#if PHI_SPATIAL
    phi_matrix_product(turn, element, change);
#else
    phi_matrix_product(element, turn, change);
#endif
}

#else
/* The product of two quaternions. */
static inline void phi_quaternion_product(const double a[4], const double b[4], double product[4])
{
    product[0] = (a[0] * b[0] - a[1] * b[1]) - (a[2] * b[2] + a[3] * b[3]);
    product[1] = (a[0] * b[1] + a[1] * b[0]) + (a[2] * b[3] - a[3] * b[2]);
    product[2] = (a[0] * b[2] + a[2] * b[0]) + (a[3] * b[1] - a[1] * b[3]);
    product[3] = (a[0] * b[3] + a[3] * b[0]) + (a[1] * b[2] - a[2] * b[1]);
}

#if PHI_POSITION
/* What rotating a vector by a quaternion adds to it. */
static void phi_rotation(const double q[4], const double v[3], double change[3])
{
    const double x = q[2] * v[2] - q[3] * v[1], y = q[3] * v[0] - q[1] * v[2], z = q[1] * v[1] - q[2] * v[0];
    change[0] = 2.0 * (q[0] * x + (q[2] * z - q[3] * y));
    change[1] = 2.0 * (q[0] * y + (q[3] * x - q[1] * z));
    change[2] = 2.0 * (q[0] * z + (q[1] * y - q[2] * x));
}

#endif
/* The product of two elements. */
static void phi_product(const double a[PHI_ELEMENT], const double b[PHI_ELEMENT], double product[PHI_ELEMENT])
{
    phi_quaternion_product(a, b, product);
#if PHI_POSITION
    phi_rotation(a, b + 4, product + 4);
    for (int i = 4; i < 7; ++i) product[i] += a[i] + b[i];
#endif
}

#if PHI_RATE_OF_GAUGE && PHI_POSITION
/* The element of the motion with a constant rate, for some time. */
static void phi_uniform(const double rate[PHI_RATE], double t, double element[PHI_ELEMENT])
{
    const double speed = sqrt(rate[0] * rate[0] + (rate[1] * rate[1] + rate[2] * rate[2]));
    const double angle = t * speed, scale = speed > 0.0 ? sin(0.5 * angle) / speed : 0.0;
    element[0] = cos(0.5 * angle);
    for (int i = 0; i < 3; ++i) element[i + 1] = scale * rate[i];
    const double *w = rate, *v = rate + 3, sine = speed > 0.0 ? sin(angle) / speed : t;
    const double versine = 2.0 * scale * scale, along = (w[0] * v[0] + w[1] * v[1]) + w[2] * v[2];
    const double rest = speed > 0.0 ? (t - sine) / (speed * speed) * along : 0.0;
    element[4] = sine * v[0] + versine * (w[1] * v[2] - w[2] * v[1]) + rest * w[0];
    element[5] = sine * v[1] + versine * (w[2] * v[0] - w[0] * v[2]) + rest * w[1];
    element[6] = sine * v[2] + versine * (w[0] * v[1] - w[1] * v[0]) + rest * w[2];
}

#endif
/* What a factor adds to an element. The quaternion of the factor is given less 1. */
static void phi_added(const double element[PHI_ELEMENT], const double turn[PHI_ELEMENT], double change[PHI_ELEMENT])
{
#if PHI_SPATIAL
    phi_quaternion_product(turn, element, change);
#else
    phi_quaternion_product(element, turn, change);
#endif
#if PHI_POSITION && PHI_SPATIAL
    const double q[4] = { 1.0 + turn[0], turn[1], turn[2], turn[3] };
    phi_rotation(q, element + 4, change + 4);
    for (int i = 4; i < 7; ++i) change[i] += turn[i];
#elif PHI_POSITION
    phi_rotation(element, turn + 4, change + 4);
    for (int i = 4; i < 7; ++i) change[i] += turn[i];
#endif
}

/* Bring the length of a quaternion nearer to 1; what rounding leaves of that has no direction, and does not add up. */
static void phi_normalise(const double q[4], double carry[4])
{
    const double excess = 0.5 * (((q[0] * q[0] - 1.0) + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3]));
    for (int i = 0; i < 4; ++i) carry[i] -= excess * q[i];
}

#endif
#if PHI_LENGTHENED
/* Divide a quaternion, given less 1, by its length. */
static void phi_shorten(double q[4])
{
    const double excess = (q[0] * (2.0 + q[0]) + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3]);
    const double length = sqrt(1.0 + excess), per = 1.0 / length;
    q[0] = per * (q[0] - excess / (1.0 + length));
    for (int i = 1; i < 4; ++i) q[i] *= per;
}

#endif
/* Multiply the element by a factor, given less 1, in compensated arithmetic. */
static void phi_turn_by(phi_solver *s, const double factor[PHI_ELEMENT])
{
    double change[PHI_ELEMENT];
    phi_added(s->turned, factor, change);
    for (int i = 0; i < PHI_ELEMENT; ++i) {
        const double moved = change[i] + s->turned_carry[i], sum = s->turned[i] + moved, added = sum - s->turned[i];
        s->turned_carry[i] = (s->turned[i] - (sum - added)) + (moved - added);
        s->turned[i] = sum;
    }
#if PHI_NORMALISE
    phi_normalise(s->turned, s->turned_carry);
#endif
}

#if PHI_IMPLICIT
/* The element of a stage that was solved by y. */
static inline void phi_turn_stage(phi_solver *s PHI_AND_INT_STAGE, const double y[PHI_DIM])
{
    double factor[PHI_ELEMENT];
#if PHI_TURNED_BY_COVECTOR
    double p[PHI_COVECTOR];
    phi_turn(PHI_OF(s->coef, stage), y, p);
    phi_matrix_exponential(p, factor);
#else
    phi_turn(PHI_OF(s->coef, stage), y, factor);
#endif
    phi_turn_by(s, factor);
}

#endif
#if PHI_BLOCKS
/* Two factors as one, in place of the first; all less 1. */
static void phi_joined(const double first[PHI_ELEMENT], const double second[PHI_ELEMENT], double both[PHI_ELEMENT])
{
    double change[PHI_ELEMENT];
#if PHI_MATRICES
    phi_added(first, second, change);
#elif PHI_SPATIAL
    phi_quaternion_product(second, first, change);
#else
    phi_quaternion_product(first, second, change);
#endif
#if PHI_POSITION && PHI_SPATIAL
    const double q[4] = { 1.0 + second[0], second[1], second[2], second[3] };
    phi_rotation(q, first + 4, change + 4);
#elif PHI_POSITION
    const double q[4] = { 1.0 + first[0], first[1], first[2], first[3] };
    phi_rotation(q, second + 4, change + 4);
#endif
    for (int i = 0; i < PHI_ELEMENT; ++i) both[i] = (first[i] + second[i]) + change[i];
}

/* Multiply by the elements of many stages in turn. */
static void phi_turn_sequence(phi_solver *s, double sequence[][PHI_ELEMENT], int count)
{
    for (; count % 2 == 0; count /= 2) /* neighbours first: their products do not wait for one another */
        for (int k = 0; k < count / 2; ++k) phi_joined(sequence[2 * k], sequence[2 * k + 1], sequence[k]);
    for (int k = 0; k < count; ++k) phi_turn_by(s, sequence[k]);
}

#endif
/* The attitude proper: the first, then what the Casimirs that were taken from H have turned it by, which in the frame where
   momenta are constant is a uniform motion, then the product of the elements of all steps. */
static void phi_read_attitude(phi_solver *s)
{
    double found[PHI_ELEMENT], element[PHI_ELEMENT];
#if PHI_TURNS_ASIDE
    const double half = 0.5 * (s->t - s->attitude_from) * s->speed, c = cos(half), sine = sin(half);
    for (int i = 0; i < 4; ++i) element[i] = c * s->first[i] + sine * s->aside[i];
#elif PHI_RATE_OF_GAUGE
    double uniform[PHI_ELEMENT];
    phi_uniform(s->rate, s->t - s->attitude_from, uniform);
#if PHI_SPATIAL
    phi_product(uniform, s->first, element);
#else
    phi_product(s->first, uniform, element);
#endif
#else
    memcpy(element, s->first, sizeof element);
#endif
#if PHI_SPATIAL
    phi_product(s->turned, element, found);
#else
    phi_product(element, s->turned, found);
#endif
    memcpy(s->attitude, found, sizeof s->attitude);
#if PHI_POSITION
    memcpy(s->position, found + 4, sizeof s->position);
#endif
}

/* Begin at an element, where x is now. */
static void phi_begin_attitude(phi_solver *s, const double first[PHI_ELEMENT])
{
    memcpy(s->first, first, sizeof s->first);
    memset(s->turned, 0, sizeof s->turned);
    memset(s->turned_carry, 0, sizeof s->turned_carry);
#if PHI_MATRICES
    for (int i = 0; i < PHI_ELEMENT; i += PHI_ROWS_OF_ATTITUDE + 1) s->turned[i] = 1.0;
#else
    s->turned[0] = 1.0;
#endif
#if PHI_TURNS_ASIDE
    double rate[PHI_RATE], axis[4] = { 0.0 };
#elif PHI_RATE_OF_GAUGE
    double *rate = s->rate;
#endif
#if PHI_RATE_OF_GAUGE && PHI_GAUGE
    phi_rate(&s->params, s->gauge, s->x, rate);
#elif PHI_RATE_OF_GAUGE
    phi_rate(&s->params, s->x, rate);
#endif
#if PHI_TURNS_ASIDE
    s->speed = sqrt(rate[0] * rate[0] + (rate[1] * rate[1] + rate[2] * rate[2]));
    for (int i = 0; i < 3 && s->speed > 0.0; ++i) axis[i + 1] = rate[i] / s->speed;
#if PHI_SPATIAL
    phi_product(axis, s->first, s->aside);
#else
    phi_product(s->first, axis, s->aside);
#endif
#endif
#if PHI_RATE_OF_GAUGE
    s->attitude_from = s->t;
#endif
    phi_read_attitude(s);
}

#if PHI_POSITION
phi_status phi_set_attitude(phi_solver *s, const double attitude[PHI_ATTITUDE_SIZE], const double position[3])
#else
phi_status phi_set_attitude(phi_solver *s, const double attitude[PHI_ATTITUDE_SIZE])
#endif
{
    double first[PHI_ELEMENT], size = 0.0;
    if (s == NULL || attitude == NULL) return PHI_BAD_ARGUMENT;
    memcpy(first, attitude, PHI_ATTITUDE_SIZE * sizeof first[0]);
#if PHI_POSITION
    if (position != NULL) memcpy(first + 4, position, 3 * sizeof first[0]);
    else memset(first + 4, 0, 3 * sizeof first[0]);
#endif
    for (int i = 0; i < PHI_ELEMENT; ++i)
        if (!isfinite(first[i])) return PHI_BAD_ARGUMENT;
    for (int i = 0; i < PHI_ATTITUDE_SIZE; ++i) size = fabs(first[i]) > size ? fabs(first[i]) : size;
    if (!(size > 0.0)) return PHI_BAD_ARGUMENT;
#if !PHI_MATRICES
    double square = 0.0;
    for (int i = 0; i < 4; ++i) square += first[i] * first[i];
    if (!(fabs(square - 1.0) <= 4.0 * DBL_EPSILON)) { /* else it has been divided by its length before */
        square = 0.0;
        for (int i = 0; i < 4; ++i) {
            first[i] /= size;
            square += first[i] * first[i];
        }
        for (int i = 0; i < 4; ++i) first[i] /= sqrt(square);
    }
#endif
    phi_begin_attitude(s, first);
    return PHI_OK;
}

void phi_attitude(const phi_solver *s, double out[PHI_ELEMENT])
{
    memcpy(out, s->attitude, sizeof s->attitude);
#if PHI_POSITION
    memcpy(out + 4, s->position, sizeof s->position);
#endif
}
#endif
