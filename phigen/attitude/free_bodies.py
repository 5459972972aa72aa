"""The group element of the exact flow of a free rigid body, by an elliptic integral of the third kind.

Let x be the momentum in the body. It satisfies ẋ = x × ω with ω_i = w_i x_i. Let x' and ω' be the values of x and ω
after the time t. The rotation from the body at time t to the body at time 0 takes x' to x. It is the product of two
rotations: M, the shortest one that takes x' to x, and a rotation about x by the angle θ|x|. As a quaternion that is not
of unit length,

    M = (|x|² + x·x', x' × x),    θ̇ = ω'·(x + x')/(|x|² + x·x').

Let l, m, h be the axes with the lowest, the middle and the highest value of the E_i in `phigen.splitting.euler`, which
also defines P and R. S, C, D and κ are defined in `phigen.symbolic.elliptic`. Let z = Pκ² and L = |x|, and

    β_l = w_h − w_m,  β_m = w_l − w_h,  β_h = w_m − w_l,  c = β_h x_m² − β_m x_h²,  n = β_m c ≤ 0,
    W = (β_l x_m² − β_m x_l²)c/L²,  T = 4κ/(1 + z),  Q = P − R.

Then θ = t w_l − β_h n ∫S²/(1 − nS²)dt + χ/L, where χ is the polar angle of the point

    (1 − (Q − WC)T²/(2 + 2D),  LS(c/L² + β_m(Q + W)T²/(2 + 2D))).

An error of θ does not change the momentum in space. Near x' = −x, where M is undefined, the attitude has relative
errors of about 1e-16/ν with ν = 1 + x·x'/|x|². This occurs near the separatrix, when the body moves from one unstable
rotation to the opposite one. If x are momenta in space, the element is the inverse of the element for −H.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from phigen.attitude.elements import cross, dot, product, rotated, rotation_by
from phigen.attitude.group import Group
from phigen.splitting.euler import CYCLIC, EulerMotion, levels_of, moved
from phigen.symbolic.elliptic import THIRD, functions_of
from phigen.symbolic.expression import ONE, ZERO, Expression, call, derivative, derivatives, power, sqrt, symbol, total
from phigen.symbolic.symbols import Symbol

Vector = Sequence[Expression]


def rotates(group: Group) -> bool:
    """Whether the elements of a group are rotations in space: quaternions, or the 3×3 matrices of so(3)."""
    if not group.matrices:
        return True
    if (group.dimension, group.rows) != (3, 3) or not group.orthogonal:
        return False
    units = [[ONE if i == k else ZERO for i in range(3)] for k in range(3)]
    return all(dot(e, e).value == 2 for e in map(group.generator, units))


def elements(motion: EulerMotion, group: Group, t: Expression) -> list[list[Expression]]:
    """Return two group elements, each minus 1. Their product is the group element of the flow of a free rigid body for
    the time ``t``.
    """
    weights = [derivative(derivative(motion.hamiltonian, name), name) for name in motion.coordinates]
    addition = motion.addition(t)
    x, changes = addition.x, addition.changes()
    signed = [-w for w in weights] if group.spatial else weights
    s, c, _ = functions_of(addition.kappa, addition.p, addition.r)
    axes = _SortedAxes(addition.sorted(x), addition.sorted(signed), dot(x, x), call("inv0", dot(x, x)))
    z = addition.p * addition.kappa**2
    stretched = (4 * addition.kappa * power(1 + z, -1)) ** 2
    d = sqrt(c**2 + addition.r * s**2)
    perpendicular, axial = axes.point(addition.p - addition.r, ONE, stretched, s, c, d)
    length = sqrt(axes.square)
    chi = call("atan2", length * axial, perpendicular) * call("inv0", length)
    rate, factor = axes.linear
    theta = t * rate + factor * call(THIRD, t, addition.p, addition.r, axes.n) + chi
    inverse = call("inv0", 2 * axes.square + dot(x, changes))
    shortest = [ZERO, *(inverse * e for e in cross(changes, x))]
    rotations = [list(rotation_by([theta * e for e in x], ())), shortest]
    rotations = [[q[0], *(-e for e in q[1:])] for q in rotations] if group.spatial else rotations
    if group.matrices:
        return [_matrix(group, q) for q in rotations]
    return [[*q, *(ZERO for _ in group.translation)] for q in rotations]


def _matrix(group: Group, q: Vector) -> list[Expression]:
    """Return the rotation matrix, minus 1, for the quaternion 1 + q, which need not have unit length."""
    once = group.generator(q[1:])
    w, rows = ONE + q[0], group.rows
    scale = 2 * power(w**2 + dot(q[1:], q[1:]), -1)
    twice = [
        total(once[i * rows + k] * once[k * rows + j] for k in range(rows)) for i in range(rows) for j in range(rows)
    ]
    return [scale * (w * a + b) for a, b in zip(once, twice, strict=True)]


@dataclass(frozen=True)
class _SortedAxes:
    """The momentum ``x`` and the inverse moments ``weights`` of a rigid body.

    The components are in the order l, m, h of the axes, which is defined at the head of the file. ``square`` is L² =
    |x|², ``inverse`` is 1/L².
    """

    x: Vector
    weights: Vector
    square: Expression
    inverse: Expression

    @property
    def betas(self) -> tuple[Expression, Expression, Expression]:
        """The differences β_l = w_h − w_m, β_m = w_l − w_h and β_h = w_m − w_l of the inverse moments w, for the axes
        l, m, h."""
        low, middle, high = self.weights
        return high - middle, low - high, middle - low

    @property
    def c(self) -> Expression:
        """The constant c = β_h x_m² − β_m x_h², in the notation of the head of the file."""
        _, of_m, of_h = self.betas
        return of_h * self.x[1] ** 2 - of_m * self.x[2] ** 2

    @property
    def n(self) -> Expression:
        """The parameter n = β_m c ≤ 0 of the elliptic integral of the third kind; see the head of the file."""
        return self.betas[1] * self.c

    @property
    def linear(self) -> tuple[Expression, Expression]:
        """The coefficients w_l and −β_h n in the formula for θ at the head of the file."""
        return self.weights[0], -(self.betas[2] * self.n)

    def point(
        self, q: Expression, unit: Expression, square: Expression, s: Expression, c: Expression, d: Expression
    ) -> tuple[Expression, Expression]:
        """Return the coordinates of the point whose polar angle is χ. The second coordinate is divided by L.

        The point is defined at the head of the file. ``q``, ``s``, ``c`` and ``d`` are Q, S, C and D; ``square`` is T²,
        and ``unit`` is 1. To avoid a division, ``unit`` and ``square`` may be multiplied by the same number, which does
        not change χ.
        """
        of_l, of_m, _ = self.betas
        ratio = self.c * self.inverse
        w = (of_l * self.x[1] ** 2 - of_m * self.x[0] ** 2) * ratio
        share = square * power(2 * (1 + d), -1)
        return unit - (q - w * c) * share, s * (unit * ratio + of_m * (q + w) * share)


def identities() -> Iterator[tuple[str, Expression]]:
    """Yield pairs of a label and an expression. If all expressions are 0, the formulas at the head of the file are
    correct.

    Two other formulas are assumed: the formula for the momentum x' after the flow, which `phigen.splitting.euler`
    proves, and dS/dt = CD (see `phigen.symbolic.elliptic`).
    """
    yield from _shortest_rotation()
    for order in ((0, 2, 1), (1, 2, 0)):  # all other orders of the axes are cyclic permutations of one of these
        yield from _angle(order)


def _shortest_rotation() -> Iterator[tuple[str, Expression]]:
    """Yield pairs of a label and an expression for the shortest rotation that takes x' to x.

    Let the quaternion M, of any length, be this rotation, and ω any angular velocity. If all expressions are 0, two
    statements hold: M rotates x' to x; and the vector part of M⁻¹Ṁ is (ω − θ̇x')/2. The head of the file has the
    formula for θ̇.
    """
    x, omega = ([symbol(Symbol("attitude", kind, i)) for i in range(3)] for kind in ("x", "ω"))
    end = [symbol(Symbol("attitude", "end", i)) for i in range(2)]
    end.append(sqrt(dot(x, x) - dot(end, end)))
    rates = cross(end, omega)
    m = [dot(x, x) + dot(x, end), *cross(end, x)]
    slope = [dot(x, rates), *cross(rates, x)]
    square = dot(m, m)
    yield from (("M x' = x", a - square * b) for a, b in zip(rotated(m, end), x, strict=True))
    theta = dot(omega, [a + b for a, b in zip(x, end, strict=True)])
    rotated_slope = product([m[0], *(-e for e in m[1:])], slope)[1:]
    for a, o, e in zip(rotated_slope, omega, end, strict=True):
        yield "dM/dt", 2 * m[0] * a - square * (m[0] * o - theta * e)


def _angle(order: Sequence[int]) -> Iterator[tuple[str, Expression]]:
    """Yield a label and an expression. If the expression is 0, the formula for θ̇ is the time derivative of the formula
    for θ.

    Both formulas are at the head of the file. ``order`` has the indices of the axes l, m and h.
    """
    x, w = ([symbol(Symbol("attitude", kind, i)) for i in range(3)] for kind in ("x", "w"))
    name = Symbol("attitude", "S")
    s, factors = symbol(name), [w[k] - w[j] for j, k in CYCLIC]
    levels = levels_of(x, factors)
    low, middle, high = (levels[i] for i in order)
    c, d = (sqrt(1 - (high - e) * s**2) for e in (low, middle))
    sigma = [dict(zip(order, (c, d, ONE), strict=True))[i] for i in range(3)]
    end = moved(x, factors, sigma, s, 1 - high * s**2)
    axes = _SortedAxes([x[i] for i in order], [w[i] for i in order], dot(x, x), power(dot(x, x), -1))
    perpendicular, axial = axes.point(high - middle, (1 + c) / 2, s**2, s, c, d)
    slopes = [c * d * e for e in derivatives([perpendicular, axial], name)]
    turning = (perpendicular * slopes[1] - axial * slopes[0]) * power(perpendicular**2 + axes.square * axial**2, -1)
    rate, factor = axes.linear
    theta = turning + rate + factor * s**2 * power(1 - axes.n * s**2, -1)
    omega = [a * b for a, b in zip(w, end, strict=True)]
    bisector = [a + b for a, b in zip(x, end, strict=True)]
    yield "rate of θ", theta * (axes.square + dot(x, end)) - dot(omega, bisector)
