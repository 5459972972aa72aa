#ifndef PHI_FILE_ATTITUDE
#define PHI_FILE_ATTITUDE
#include <float.h>
#include <math.h>
#include <string.h>

#include "model.h"

/* ---- Attitude ---- */
#if PHI_MATRICES
/* The product of two square matrices. */
static void phi_group_product(const double a[PHI_ELEMENT], const double b[PHI_ELEMENT], double product[PHI_ELEMENT])
{
    enum { N = PHI_ROWS_OF_ATTITUDE };
    for (int i = 0; i < N; ++i)
        for (int j = 0; j < N; ++j) {
            double sum = 0.0;
            for (int k = 0; k < N; ++k) sum += a[i * N + k] * b[k * N + j];
            product[i * N + j] = sum;
        }
}

/* Make a factor, given less 1, that brings a matrix which is nearly orthogonal nearer to that. */
static void phi_normalise(const double g[PHI_ELEMENT], double factor[PHI_ELEMENT])
{
    enum { N = PHI_ROWS_OF_ATTITUDE };
    double excess[PHI_ELEMENT], change[PHI_ELEMENT];
    for (int i = 0; i < N; ++i)
        for (int j = 0; j < N; ++j) {
            double sum = i == j ? -1.0 : 0.0;
#if PHI_SPATIAL
            for (int k = 0; k < N; ++k) sum += g[i * N + k] * g[j * N + k];
#else
            for (int k = 0; k < N; ++k) sum += g[k * N + i] * g[k * N + j];
#endif
            excess[i * N + j] = 0.5 * sum;
        }
    PHI_ADDED_FACTOR(excess, factor, change);
    for (int i = 0; i < PHI_ELEMENT; ++i) factor[i] -= excess[i] + change[i];
}

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
        phi_group_product(element, element, square);
        for (int i = 0; i < PHI_ELEMENT; ++i) element[i] = 2.0 * element[i] + square[i];
#if PHI_NORMALISE
        memcpy(square, element, sizeof square);
        for (int i = 0; i < PHI_ELEMENT; i += PHI_ROWS_OF_ATTITUDE + 1) square[i] += 1.0;
        phi_normalise(square, element);
#endif
    }
}

/* The element, less 1, of the motion with a constant rate, for some time. */
static void phi_uniform(const double rate[PHI_RATE], double t, double element[PHI_ELEMENT])
{
    double p[PHI_RATE];
    for (int i = 0; i < PHI_SIZE; ++i) p[i] = t * rate[i];
    p[PHI_SIZE] = t * t * rate[PHI_SIZE];
    phi_matrix_exponential(p, element);
}

#else
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
#if PHI_RATE_OF_GAUGE
/* Multiply the element by a factor of a step, in compensated arithmetic, and from the other side by one that is the same for
   all steps: in the frame where momenta are constant, the Casimirs that are taken from H turn uniformly. Both are given less
   1; the other may be NULL. */
static inline void phi_turn_by(phi_solver *s, double factor[PHI_ELEMENT], const double *aside)
#else
/* Multiply the element by a factor of a step, given less 1, in compensated arithmetic. */
static inline void phi_turn_by(phi_solver *s, double factor[PHI_ELEMENT])
#endif
{
    double change[PHI_ELEMENT], element[PHI_ELEMENT], carry[PHI_ELEMENT];
    memcpy(element, s->turned, sizeof element);
    memcpy(carry, s->turned_carry, sizeof carry);
#if PHI_NORMALISE
    phi_normalise(element, factor);
#endif
#if PHI_RATE_OF_GAUGE
    if (aside != NULL) {
        PHI_ADDED_ASIDE(s->turned, aside, change);
        for (int i = 0; i < PHI_ELEMENT; ++i) element[i] += change[i];
        for (int i = 0; i < PHI_ELEMENT; ++i) carry[i] += change[i];
    }
#endif
    PHI_ADDED_FACTOR(element, factor, change);
    for (int i = 0; i < PHI_ELEMENT; ++i) {
        const double moved = change[i] + carry[i], sum = s->turned[i] + moved;
        s->turned_carry[i] = moved - (sum - s->turned[i]);
        s->turned[i] = sum;
    }
}

/* What these Casimirs turn in one step, and in a block of steps. */
static void phi_set_aside(phi_solver *s)
{
    phi_uniform(s->rate, s->h, s->aside);
#if PHI_BLOCKS
    phi_uniform(s->rate, (double)PHI_AHEAD * s->h, s->aside_of_block);
#endif
}

/* The element, less 1, of a stage that was solved by y. */
static inline void phi_factor(const phi_solver *s PHI_AND_INT_STAGE, const double y[PHI_DIM], double factor[PHI_ELEMENT])
{
#if PHI_TURNED_BY_COVECTOR
    double p[PHI_COVECTOR];
    phi_turn(PHI_OF(s->coef, stage), y, p);
    phi_matrix_exponential(p, factor);
#else
    phi_turn(PHI_OF(s->coef, stage), y, factor);
#endif
}

/* Two factors as one, in place of the first; all less 1. */
static void phi_joined(const double first[PHI_ELEMENT], const double second[PHI_ELEMENT], double both[PHI_ELEMENT])
{
    double whole[PHI_ELEMENT], change[PHI_ELEMENT];
    memcpy(whole, first, sizeof whole);
#if PHI_MATRICES
    for (int i = 0; i < PHI_ELEMENT; i += PHI_ROWS_OF_ATTITUDE + 1) whole[i] += 1.0;
#else
    whole[0] += 1.0;
#endif
    PHI_ADDED_FACTOR(whole, second, change);
    for (int i = 0; i < PHI_ELEMENT; ++i) both[i] = first[i] + change[i];
}

/* Multiply by the elements of the stages of a block in turn. */
static void phi_turn_sequence(phi_solver *s, double sequence[][PHI_ELEMENT], int count)
{
    for (; count % 2 == 0; count /= 2) /* neighbours first: their products do not wait for one another */
        for (int k = 0; k < count / 2; ++k) phi_joined(sequence[2 * k], sequence[2 * k + 1], sequence[k]);
#if PHI_RATE_OF_GAUGE
    for (int k = 0; k < count; ++k) phi_turn_by(s, sequence[k], k == 0 ? s->aside_of_block : NULL);
#else
    for (int k = 0; k < count; ++k) phi_turn_by(s, sequence[k]);
#endif
}

/* The attitude proper. */
static void phi_read_attitude(phi_solver *s)
{
#if PHI_MATRICES && PHI_SPATIAL
    phi_group_product(s->turned, s->first, s->attitude);
#elif PHI_MATRICES
    phi_group_product(s->first, s->turned, s->attitude);
#else
    memcpy(s->attitude, s->turned, sizeof s->attitude);
#endif
#if PHI_POSITION
    memcpy(s->position, s->turned + 4, sizeof s->position);
#endif
}

/* Where x or the attitude has been set: the rate at which the Casimirs that are taken from H turn from here on. */
static void phi_take_rate(phi_solver *s)
{
    phi_rate(&s->params PHI_AND_GAUGE(s->gauge), s->x, s->rate);
#if !PHI_MATRICES
    phi_carry_rate(s->turned, s->rate);
#endif
    phi_set_aside(s);
}

/* Begin at an element, where x is now. */
static void phi_begin_attitude(phi_solver *s, const double first[PHI_ELEMENT])
{
    memset(s->turned_carry, 0, sizeof s->turned_carry);
#if PHI_MATRICES
    memmove(s->first, first, sizeof s->first);
    memset(s->turned, 0, sizeof s->turned);
    for (int i = 0; i < PHI_ELEMENT; i += PHI_ROWS_OF_ATTITUDE + 1) s->turned[i] = 1.0;
#else
    memcpy(s->turned, first, sizeof s->turned);
#endif
#if PHI_RATE_OF_GAUGE
    phi_take_rate(s);
#endif
    phi_read_attitude(s);
}

phi_status phi_set_attitude(phi_solver *s, const double attitude[PHI_ATTITUDE_SIZE] PHI_AND_POSITION(const double position[3]))
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
