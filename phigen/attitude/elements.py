"""Elements of the group of rotations, and of rotations with translations, as formulas without cancellation.

A rotation is represented by its unit quaternion (w, x, y, z) minus (1, 0, 0, 0), whose entries are small for small
rotations. For a rotation vector p, let s = |p|², and φ be the function of `phigen.symbolic.special`. Then exp(p/2) is
the quaternion (c, p/4) divided by its length, where c = 1 − φ(s/4)s/4. Its square exp(p) contains no root:

    (c² − u, cp/2)/(c² + u),    u = s/16.

The Cayley transform of p is (1, p/2) divided by its length. Let t be the vector of a translation. The translation of
exp(p, t) is

    (c(c² − u) t + c²/2 p×t + (c + 2c² + u − 4c³φ(s/4))/16 p (p·t))/(c² + u)²

and the translation of the Cayley transform is (t + ½p×t + ¼p (p·t))/(1 + s/4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from phigen.symbolic.expression import ONE, ZERO, Expression, call, number, sqrt, total

Vector = Sequence[Expression]

_HALF = number(Fraction(1, 2))


@dataclass(frozen=True)
class Direction:
    """A group element whose quaternion and translation have not yet been divided by lengths.

    The rotation is the quaternion ``turn`` divided by its ``length``; the translation is ``shift`` divided by
    ``length``². ``factor`` is the ratio of ``turn`` to the quaternion (1 − sφ, p/2) of `with_phi`.
    """

    turn: tuple[Expression, ...]
    shift: tuple[Expression, ...]
    length: Expression
    factor: Expression = ONE


def direction(p: Vector, t: Vector, *, cayley: bool) -> Direction:
    """Return exp(p, t), or the Cayley transform of (p, t) if ``cayley``, not yet divided by its ``length``.

    p is the rotation vector and t the translation; ``t`` is empty for rotations.
    """
    s = dot(p, p)
    if cayley:
        increment = with_phi(p, t, ZERO)
        return replace(increment, length=sqrt(increment.length))
    phi, u = call("phi0", s / 4), s / 16
    c = ONE - s / 4 * phi
    square = c**2
    quaternion = (square - u, *(c / 2 * pi for pi in p))
    factors = (c * (square - u), square / 2, (c + 2 * square + u - 4 * c * square * phi) / 16)
    return Direction(quaternion, _shift(p, t, factors), square + u, c)


def with_phi(p: Vector, t: Vector, phi: Expression) -> Direction:
    """Return the element with the quaternion (1 − sφ, p/2), where s = |p|² and φ has any value.

    φ = 0 gives the Cayley transform. The quaternion and the translation are not yet normalised. The field ``length`` of
    the result is the square of the length of the quaternion.
    """
    s = dot(p, p)
    c = ONE - s * phi
    return Direction((c, *(pi / 2 for pi in p)), _shift(p, t, (c, _HALF, (ONE - 4 * c * phi) / 4)), c**2 + s / 4)


def _shift(p: Vector, t: Vector, factors: Vector) -> tuple[Expression, ...]:
    """Return the sum of t, p×t and p (p·t), each times one of three ``factors``; () if ``t`` is empty."""
    if not t:
        return ()
    a, b, axial = factors[0], factors[1], factors[2] * dot(p, t)
    return tuple(a * u + b * v + axial * w for u, v, w in zip(t, cross(p, t), p, strict=True))


def element(p: Vector, t: Vector, *, cayley: bool) -> tuple[Expression, ...]:
    """Return the four components of q − 1, where q is the unit quaternion of exp(p) or, if ``cayley``, of the Cayley
    transform of p.

    Unless ``t`` is empty, the three components of the translation are appended.
    """
    increment = direction(p, t, cayley=cayley)
    per = ONE / increment.length
    s = dot(p, p)
    shorter = s / 4 * per / (ONE + increment.length) if cayley else s / 8 * per
    return (-shorter, *(per * v for v in increment.turn[1:]), *(per**2 * a for a in increment.shift))


def rotation_by(r: Vector, t: Vector) -> tuple[Expression, ...]:
    """Return exp(r) − 1 or, with a translation t, exp(r, t) − 1, for a rotation vector r of any length.

    For a rotation about a coordinate axis without translation, the quaternion is (1, tan(|r|/2)) with the tangent along
    the axis. This quaternion is the cheapest, since the flow computes sin and cos of the angle |r| anyway. It is not of
    unit length, but products of elements are normalised at the end of a step. With a translation, the quaternion uses
    sin and 1 − cos of half the angle. The increments of the flow are then computed from these functions too (see
    `phigen.attitude.flow_elements.by_angles`).
    """
    s, turning = dot(r, r), [ri for ri in r if not ri.is_zero]
    if len(turning) == 1 and not t:
        tangent = call("tanhalf", call("sin", turning[0]), call("versin", turning[0]))
        return (ZERO, *(ri if ri.is_zero else tangent for ri in r))
    if len(turning) == 1:
        half_angle = turning[0] / 2
        rotation = (-ONE * call("versin", half_angle), *(ri if ri.is_zero else call("sin", half_angle) for ri in r))
    else:
        sine, cosine = call("sinroot", s / 16), call("cosroot", s / 16)
        rotation = (-(s / 8) * sine**2, *(_HALF * (sine * cosine) * ri for ri in r))
    if not t:
        return rotation
    once = cross(r, t)
    versine, arc_factor = _HALF * call("sinroot", s / 4) ** 2, call("arcroot", s)
    return (*rotation, *(a + versine * b + arc_factor * c for a, b, c in zip(t, once, cross(r, once), strict=True)))


def dot(a: Vector, b: Vector) -> Expression:
    """Return the scalar product a·b."""
    return total(x * y for x, y in zip(a, b, strict=True))


def cross(a: Vector, b: Vector) -> list[Expression]:
    """Return the vector product a × b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def product(a: Vector, b: Vector) -> list[Expression]:
    """Return the product of two quaternions with the components (w, x, y, z)."""
    cross_product = cross(a[1:], b[1:])
    return [
        a[0] * b[0] - dot(a[1:], b[1:]),
        *(a[0] * y + b[0] * x + z for x, y, z in zip(a[1:], b[1:], cross_product, strict=True)),
    ]


def rotated(q: Vector, v: Vector) -> list[Expression]:
    """Return q v q̄: the vector v, rotated by the quaternion q and scaled by |q|²."""
    w, u = q[0], q[1:]
    axial, size, once = dot(u, v), w**2 - dot(u, u), cross(u, v)
    return [size * a + 2 * axial * b + 2 * w * c for a, b, c in zip(v, u, once, strict=True)]
