#ifndef PHI_FILE_ATTITUDE
#define PHI_FILE_ATTITUDE
#include <float.h>
#include <math.h>
#include <string.h>

#include "model.h"

/* ---- Attitude ---- */
#include "attitude_matrices.c"
#include "attitude_quaternions.c"

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
