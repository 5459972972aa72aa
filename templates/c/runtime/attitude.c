#ifndef PHI_FILE_ATTITUDE
#define PHI_FILE_ATTITUDE
#include <math.h>
#include <string.h>

#include "model.h"

/* ---- Attitude ---- */
#include "attitude_matrices.c"
#include "attitude_quaternions.c"
#include "attitude_position.c"
#include "attitude_gauge.c"

/* Multiply s->turned, the group element of the attitude, by 1 + factor, the attitude increment of a step or stage, in
   compensated arithmetic. */
#if PHI_RATE_OF_GAUGE
/* Then multiply it from the opposite side by 1 + aside, the gauge rotation in the time of the step; NULL for none. */
#endif
static inline void phi_turn_by(phi_solver *s, double factor[PHI_ELEMENT] PHI_AND_DOUBLE_ASIDE)
{
    double change[PHI_ELEMENT], element[PHI_ELEMENT], carry[PHI_ELEMENT];
    memcpy(element, s->turned, sizeof element);
    memcpy(carry, s->turned_carry, sizeof carry);
    phi_normalise(element, factor);
    phi_add_aside(s, aside, element, carry);
    PHI_ADDED_FACTOR(element, factor, change);
    for (int i = 0; i < PHI_ELEMENT; ++i) {
        const double total = change[i] + carry[i], sum = s->turned[i] + total;
        s->turned_carry[i] = total - (sum - s->turned[i]);
        s->turned[i] = sum;
    }
}

#include "attitude_element.c"
#include "attitude_covector.c"

/* Compute the product of two attitude increments. Factors and product are stored as their differences from the identity. */
static void phi_joined(const double first[PHI_ELEMENT], const double second[PHI_ELEMENT], double both[PHI_ELEMENT])
{
    double element_of_first[PHI_ELEMENT], change[PHI_ELEMENT];
    memcpy(element_of_first, first, sizeof element_of_first);
    phi_add_identity(element_of_first);
    PHI_ADDED_FACTOR(element_of_first, second, change);
    for (int i = 0; i < PHI_ELEMENT; ++i) both[i] = first[i] + change[i];
}

/* Multiply the attitude by the increments of all stages in a block of steps, in order of time. `sequence` is
   overwritten. */
static void phi_turn_sequence(phi_solver *s, double sequence[][PHI_ELEMENT], int count)
{
    for (; count % 2 == 0; count /= 2) /* products of pairs first, since they do not wait for each other */
        for (int k = 0; k < count / 2; ++k) phi_joined(sequence[2 * k], sequence[2 * k + 1], sequence[k]);
    for (int k = 0; k < count; ++k) phi_turn_by(s, sequence[k] PHI_AND_ASIDE_OF_BLOCK);
}

/* Make the group element `first` the attitude of the present state. */
static void phi_begin_attitude(phi_solver *s, const double first[PHI_ELEMENT])
{
    memset(s->turned_carry, 0, sizeof s->turned_carry);
    phi_take_element(s, first);
    phi_take_rate(s);
    phi_read_attitude(s);
}

/* Compute the rate of the gauge rotation anew, after a change of the state or of the parameters. */
static void phi_renew_rate(phi_solver *s)
{
#if PHI_MATRICES
    phi_begin_attitude(s, s->attitude);
#else
    phi_take_rate(s);
#endif
}

/* Initialise the attitude with the identity. */
static void phi_begin_unturned(phi_solver *s)
{
    double identity[PHI_ELEMENT] = { 0.0 };
    phi_add_identity(identity);
    phi_begin_attitude(s, identity);
}

/* Update the public attitude at the end of a run; returns the status of the run. */
static phi_status phi_end_turning(phi_solver *s, phi_status status)
{
    phi_read_attitude(s);
    return status;
}

phi_status phi_set_attitude(phi_solver *s, const double attitude[PHI_ATTITUDE_SIZE] PHI_AND_POSITION(const double position[3]))
{
    double first[PHI_ELEMENT], size = 0.0;
    if (s == NULL || attitude == NULL) return PHI_BAD_ARGUMENT;
    memcpy(first, attitude, PHI_ATTITUDE_SIZE * sizeof first[0]);
    phi_take_position(position, first);
    for (int i = 0; i < PHI_ELEMENT; ++i)
        if (!isfinite(first[i])) return PHI_BAD_ARGUMENT;
    for (int i = 0; i < PHI_ATTITUDE_SIZE; ++i) size = fabs(first[i]) > size ? fabs(first[i]) : size;
    if (!(size > 0.0)) return PHI_BAD_ARGUMENT;
    phi_make_unit(first, size);
    phi_begin_attitude(s, first);
    return PHI_OK;
}

void phi_attitude(const phi_solver *s, double out[PHI_ELEMENT])
{
    memcpy(out, s->attitude, sizeof s->attitude);
    phi_put_position(s, out);
}
#endif
