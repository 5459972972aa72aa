#ifndef PHI_FILE_LATTICE_BODIES
#define PHI_FILE_LATTICE_BODIES
#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "sweeps.h"

/* ---- Relative coordinates of bodies ---- */
/* Flows act on relative positions and velocities. The values of the first body are replaced by those of the centre of
   mass of all bodies. In Jacobi coordinates, the values of each later body are relative to the centre of mass of all
   bodies before it. In democratic heliocentric coordinates, positions are relative to the first body, and velocities to
   the centre of mass. */

/* Compute the central masses of Kepler motions. Returns 0 if a mass is not admissible: masses must not be negative,
   their sum must be finite, and the masses of the first body and of bodies with momenta must be positive. */
static int phi_weigh(phi_solver *s)
{
    const double *m = s->x[PHI_MASS];
    s->massive = 0;
    s->mass = 0.0;
    for (ptrdiff_t i = 0; i < s->length; ++i) {
        if (m[i] < 0.0 PHI_OR_NO_MASS(m[i])) return 0;
        if (m[i] > 0.0) s->massive = i + 1;
        s->mass += m[i];
#if PHI_JACOBI
        s->x[PHI_INNER][i] = s->mass;
#else
        s->x[PHI_INNER][i] = m[0];
#endif
    }
    return m[0] > 0.0 && isfinite(s->mass);
}

#if PHI_JACOBI
/* Transform the positions, or the velocities, of all bodies along one axis to relative ones. */
static void phi_make_relative(const phi_solver *s, double *q)
{
    const double *m = s->x[PHI_MASS], *inner = s->x[PHI_INNER];
    double centre = q[0];
    for (ptrdiff_t i = 1; i < s->length; ++i) {
        q[i] -= centre;
        centre += m[i] / inner[i] * q[i];
    }
    q[0] = centre;
}

/* Transform relative positions, or relative velocities, along one axis to those of the bodies. */
static void phi_make_cartesian(const phi_solver *s, double *q)
{
    const double *m = s->x[PHI_MASS], *inner = s->x[PHI_INNER];
    double centre = q[0];
    for (ptrdiff_t i = s->length - 1; i > 0; --i) {
        centre -= m[i] / inner[i] * q[i];
        q[i] += centre;
    }
    q[0] = centre;
}

/* Compute the positions of all bodies relative to the first body. */
static void phi_place_bodies(const phi_solver *s, double *const *x, double *const *placed)
{
    const double *m = s->x[PHI_MASS], *inner = s->x[PHI_INNER];
    for (int axis = 0; axis < PHI_BODY_AXES; ++axis) {
        const double *q = x[phi_body_axes[axis][0]];
        double *to = placed[phi_body_axes[axis][0]], centre = 0.0;
        to[0] = 0.0;
        for (ptrdiff_t i = 1; i < s->length; ++i) {
            to[i] = centre + q[i];
            centre += m[i] / inner[i] * q[i];
        }
    }
}

/* Make the acceleration of each body relative to the centre of mass of all bodies before it. Accelerations are stored
   in the sums, from index `first` on. */
static void phi_join_pulls(const phi_solver *s, int first)
{
    const double *m = s->x[PHI_MASS], *inner = s->x[PHI_INNER];
    for (int axis = 0; axis < PHI_BODY_AXES; ++axis) {
        double *pull = s->gathered[first + axis], sum = m[0] * pull[0];
        for (ptrdiff_t i = 1; i < s->length; ++i) {
            const double before = sum / inner[i - 1];
            sum += m[i] * pull[i];
            pull[i] -= before;
        }
    }
}
#else
/* The sum of m q over all bodies but the first. */
static double phi_moment(const phi_solver *s, const double *q)
{
    const double *m = s->x[PHI_MASS];
    double sum = 0.0;
    for (ptrdiff_t i = 1; i < s->massive; ++i) sum += m[i] * q[i];
    return sum;
}

/* Add a value to the coordinate of each body but the first. */
static void phi_shift_bodies(const phi_solver *s, double *q, double value)
{
    for (ptrdiff_t i = 1; i < s->length; ++i) q[i] += value;
}

/* Store the velocity (sum of m v over all bodies but the first) / m[0] for each body but the first. */
static void phi_join_shifts(const phi_solver *s, double *const *x, int first)
{
    for (int axis = 0; axis < PHI_BODY_AXES; ++axis) {
        const double shift = phi_moment(s, x[phi_body_axes[axis][1]]) / s->x[PHI_MASS][0];
        for (ptrdiff_t i = 1; i < s->length; ++i) s->gathered[first + axis][i] = shift;
    }
}
#endif

/* Transform a state, or a tangent vector, from Cartesian to relative coordinates. */
static void phi_to_relative(const phi_solver *s, double *const *x)
{
    for (int axis = 0; axis < PHI_BODY_AXES; ++axis) {
        double *q = x[phi_body_axes[axis][0]], *v = x[phi_body_axes[axis][1]];
#if PHI_MOMENTA
        for (ptrdiff_t i = 0; i < s->length; ++i) v[i] /= s->x[PHI_MASS][i];
#endif
#if PHI_JACOBI
        phi_make_relative(s, q);
        phi_make_relative(s, v);
#else
        const double star = v[0];
        phi_shift_bodies(s, q, -q[0]);
        phi_shift_bodies(s, v, -v[0]);
        q[0] += phi_moment(s, q) / s->mass;
        v[0] += phi_moment(s, v) / s->mass;
        phi_shift_bodies(s, v, star - v[0]);
#endif
    }
}

/* Clear the compensation terms, which belong to other coordinates. */
static void phi_clear_other_carry(phi_solver *s) { phi_clear_carry(s); }

/* Transform a state, or a tangent vector, from relative to Cartesian coordinates. */
static void phi_to_cartesian(const phi_solver *s, double *const *x)
{
    for (int axis = 0; axis < PHI_BODY_AXES; ++axis) {
        double *q = x[phi_body_axes[axis][0]], *v = x[phi_body_axes[axis][1]];
#if PHI_JACOBI
        phi_make_cartesian(s, q);
        phi_make_cartesian(s, v);
#else
        const double recoil = phi_moment(s, v) / s->x[PHI_MASS][0];
        q[0] -= phi_moment(s, q) / s->mass;
        phi_shift_bodies(s, q, q[0]);
        phi_shift_bodies(s, v, v[0]);
        v[0] -= recoil;
#endif
#if PHI_MOMENTA
        for (ptrdiff_t i = 0; i < s->length; ++i) v[i] *= s->x[PHI_MASS][i];
#endif
    }
}

#if PHI_SHARED
/* Compute the sums over other bodies that the part B of H reads; called by all threads together. */
static void phi_gather_pulls(const phi_solver *s, const double *coef, size_t first, size_t end)
{
#if PHI_JACOBI
    if (PHI_THREAD == 0) phi_place_bodies(s, s->x, s->placed);
    phi_wait();
#endif
    phi_gather_rows(s, coef, first, end);
    phi_wait();
    if (PHI_THREAD == 0) phi_join_pulls(s, 0);
    if (PHI_THREAD == 0) phi_join_shifts(s, s->x, PHI_BODY_AXES);
    phi_wait();
}
#else
/* Compute the sums over other bodies that the part B of H reads. */
static void phi_gather_pulls(const phi_solver *s, const double *coef)
{
    phi_place_bodies(s, s->x, s->placed);
    phi_gather_part(s, coef);
    phi_join_pulls(s, 0);
    phi_join_shifts(s, s->x, PHI_BODY_AXES);
}
#endif

#if PHI_TANGENT
/* Compute the derivatives along a tangent vector v of the sums over other bodies; called by all threads together. */
static void phi_gather_varied_pulls(const phi_solver *s, const double *coef, double *const *v, size_t first, size_t end)
{
    phi_wait(); /* until all threads have read the former sums */
#if PHI_JACOBI
    if (PHI_THREAD == 0) phi_place_bodies(s, s->x, s->placed);
    if (PHI_THREAD == 0) phi_place_bodies(s, v, s->placed_varied);
    phi_wait();
    phi_gather_tangent_rows(s, coef, s->placed_varied, first, end);
#else
    phi_gather_tangent_rows(s, coef, v, first, end);
#endif
    phi_wait();
    if (PHI_THREAD == 0) phi_join_pulls(s, PHI_BODY_AXES);
    if (PHI_THREAD == 0) phi_join_shifts(s, v, 2 * PHI_BODY_AXES);
    phi_wait();
}
#endif

/* Move the centre of mass at its constant velocity for a time; x are relative coordinates. */
static void phi_move_centre(double *const *x, double time)
{
    for (int axis = 0; axis < PHI_BODY_AXES; ++axis)
        x[phi_body_axes[axis][0]][0] += time * x[phi_body_axes[axis][1]][0];
}
#endif
