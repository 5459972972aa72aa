"""exp(tA)w − w in closed form, for the linear equations ẇ = Aw of `phigen.splitting.closure`.

The closed forms use a relation between powers of A. The entries of A are constant along the flow:

- A^k = 0: a polynomial in t
- A^{a+1} = dA^a: Σ_{k<a} (tA)^k/k! and (e^{td} − …) A^a/d^a, the terms of the exponential series from (td)^a on
- A^{a+2} = −cA^a: likewise with sin and cos of t√c, or with sinh and cosh, for a = 1 and a = 2

If d depends on the state, A/d may be 0/0 where d vanishes, so A^a/d^a is not in the ring. Then the entire functions of
`phigen.symbolic.entire` replace the quotients; they are valid for both signs of c.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from math import isqrt

from phigen.splitting.closure import LinearMotion
from phigen.splitting.ring import TIME, Ring
from phigen.symbolic.expression import Expression, call, number, sqrt, symbol, topological, total
from phigen.symbolic.tower import Poly, rational

Matrix = Sequence[Sequence[Poly]]

#: Largest number of powers of a matrix that are computed: for 64 rows, all powers would take minutes.
MOST_POWERS = 16

#: Description of a motion at a constant rate.
SHIFTED = "shifted"

_HALF = number(Fraction(1, 2))


class NoClosedFormError(Exception):
    """No closed form is known; the text names the matrix."""


@dataclass(frozen=True)
class Solution:
    """The increments of the coordinates of a linear motion, and a word that describes the motion."""

    increments: tuple[Expression, ...]
    manner: str


def solve(ring: Ring, motion: LinearMotion) -> Solution:
    """Return exp(tA)w − w for the coordinates of the motion. Raises `NoClosedFormError`."""
    w = [ring.monomial(m) for m in motion.basis]
    if len(w) == 1:
        growth = ring.expression(motion.matrix[0][0] * ring.tower.variable(TIME))
        return Solution((ring.expression(w[0]) * call("expm1", growth),), "scaled")
    powers = _powers(ring, motion.matrix)
    images = [_image(ring, power, w) for power in powers]
    solution = _nilpotent(ring, powers, images)
    for a in (1, 2):
        solution = solution or _scaling(ring, powers, images, a) or _turning(ring, powers, images, a)
    if solution is None:
        size = f"{len(w)}×{len(w)}"
        raise NoClosedFormError(f"exp(tA) with a {size} matrix A whose powers satisfy no relation that phigen can use")
    return Solution(solution.increments[: len(motion.coordinates)], solution.manner)


def _powers(ring: Ring, a: Matrix) -> list[Matrix]:
    """Return A, A², …, up to the first power that vanishes.

    If none vanishes, there are as many as A has rows, but at least 4 and at most `MOST_POWERS`.
    """
    powers = [a]
    while len(powers) < max(4, min(len(a), MOST_POWERS)) and not _vanishes(powers[-1]):
        powers.append(_product(ring, powers[-1], a))
    return powers


def _nilpotent(ring: Ring, powers: Sequence[Matrix], images: Sequence[Sequence[Poly]]) -> Solution | None:
    """Return Σ t^k A^k w/k! if some power of A vanishes, else None."""
    if not _vanishes(powers[-1]):
        return None
    tower, t, factorial = ring.tower, ring.tower.variable(TIME), 1
    total = [tower.zero] * len(images[0])
    for k, image in enumerate(images[:-1], 1):
        factorial *= k
        scale = t**k * tower.constant(Fraction(1, factorial))
        total = [tower.combine([s, scale * v]) for s, v in zip(total, image, strict=True)]
    manner = SHIFTED if len(images) == 2 else "moved by a polynomial in t"
    return Solution(tuple(ring.expression(s) for s in total), manner)


def _scaling(ring: Ring, powers: Sequence[Matrix], images: Sequence[Sequence[Poly]], a: int) -> Solution | None:
    """Return the solution if A^{a+1} = dA^a, else None."""
    d = _ratio(ring, powers[a], powers[a - 1], powers[0])
    if d is None:
        return None
    t, exponent = symbol(TIME), ring.expression(d * ring.tower.variable(TIME))
    directed = _quotients(ring, images[a - 1], d**a)
    if directed is not None:
        growth = call("expm1", exponent)
        if a == 1:
            return Solution(tuple(growth * v for v in directed), "scaled")
        first = [ring.expression(v) for v in images[0]]
        return Solution(
            tuple(t * u + (growth - exponent) * v for u, v in zip(first, directed, strict=True)), "scaled and shifted"
        )
    if a == 2:
        return None
    growth = t * call("exprel", exponent)
    return Solution(tuple(growth * ring.expression(v) for v in images[0]), "scaled")


def _turning(ring: Ring, powers: Sequence[Matrix], images: Sequence[Sequence[Poly]], a: int) -> Solution | None:
    """Return the solution if A^{a+2} = −cA^a, else None."""
    c = None if len(powers) < a + 2 else _ratio(ring, powers[a + 1], powers[a - 1], powers[1])
    if c is None:
        return None
    root = _root(ring, -c)
    e = None if root is None else root.element
    directed = None if e is None else _quotients(ring, images[a - 1], e**a)
    further = None if e is None else _quotients(ring, images[a], e ** (a + 1))
    if root is not None and directed is not None and further is not None:
        angle = root.scale * ring.expression(root.element * ring.tower.variable(TIME))
        units = [[v / root.scale**k for v in entries] for k, entries in ((a, directed), (a + 1, further))]
        first = [ring.expression(v) for v in images[0]]
        return _circular(first, units, angle, a) if root.positive else _hyperbolic(first, units, angle, a)
    return _without_quotients(ring, powers[0], images, -c, a)


def _without_quotients(
    ring: Ring, matrix: Matrix, images: Sequence[Sequence[Poly]], c: Poly, a: int
) -> Solution | None:
    """Return the solution by functions of s = ct², or None.

    sin and 1 − cos of the angle √s are computed from those of its half.
    """
    t, s = symbol(TIME), ring.expression(c * ring.tower.variable(TIME) ** 2)
    if a == 1:
        return _solution_of_scaled_matrix(ring, matrix, images, s)
    first, second, third = ([ring.expression(v) for v in image] for image in images[:3])
    speed = t * call("sinroot", s / 4)
    versine, arc_rest = _HALF * speed**2, t**3 * call("arcroot", s)
    increments = tuple(t * u + (versine * v + arc_rest * w) for u, v, w in zip(first, second, third, strict=True))
    return Solution(increments, "turned and shifted")


def _solution_of_scaled_matrix(ring: Ring, matrix: Matrix, images: Sequence[Sequence[Poly]], s: Expression) -> Solution:
    """Return the solution for a = 1, with A = fM: the static factor f of all entries multiplies the time.

    M²w is computed as M times Mw if that needs fewer operations than the entries of M², as for cross products.
    """
    factor = _static_factor(ring, matrix)
    once = [ring.expression(v / factor) for v in images[0]]
    twice = [ring.expression(v / factor**2) for v in images[1]]
    rows = [[ring.expression(e / factor) for e in row] for row in matrix]
    second_images = [total(e * v for e, v in zip(row, once, strict=True)) for row in rows]
    twice = min(twice, second_images, key=lambda entries: len(list(topological(entries))))
    speed = symbol(TIME) * ring.expression(factor) * call("sinroot", s / 4)
    sine, versine = speed * call("cosroot", s / 4), _HALF * speed**2
    return Solution(tuple(sine * u + versine * v for u, v in zip(once, twice, strict=True)), "turned")


def _static_factor(ring: Ring, a: Matrix) -> Poly:
    """Return the common factor of all entries of a matrix, if it does not depend on the state; else 1."""
    factor = reduce(lambda x, y: x.gcd(y), [e for row in a for e in row if e != 0])
    return ring.tower.constant(1) if ring.support(factor) else factor


def _circular(
    first: Sequence[Expression], units: Sequence[Sequence[Expression]], angle: Expression, a: int
) -> Solution:
    """Return the solution with sin and cos.

    It is sin(θ)A/e + (1 − cos θ)A²/e² for a = 1, and tA + (1 − cos θ)A²/e² + (θ − sin θ)A³/e³ for a = 2.
    """
    sine, versine = call("sin", angle), call("versin", angle)
    if a == 1:
        return Solution(tuple(sine * u + versine * v for u, v in zip(*units, strict=True)), "turned")
    difference, t = angle - sine, symbol(TIME)
    increments = tuple(t * f + (versine * u + difference * v) for f, u, v in zip(first, *units, strict=True))
    return Solution(increments, "turned and shifted")


def _hyperbolic(
    first: Sequence[Expression], units: Sequence[Sequence[Expression]], angle: Expression, a: int
) -> Solution:
    """Return the solution with sinh and cosh; cosh θ − 1 = 2 sinh²(θ/2) replaces 1 − cos θ."""
    s, c = call("sinh", angle / 2), call("cosh", angle / 2)
    if a == 1:
        increments = tuple(2 * s * (c * u + s * v) for u, v in zip(*units, strict=True))
        return Solution(increments, "moved along hyperbolas")
    sine, versine, t = 2 * s * c, 2 * s**2, symbol(TIME)
    difference = sine - angle
    increments = tuple(t * f + (versine * u + difference * v) for f, u, v in zip(first, *units, strict=True))
    return Solution(increments, "moved along hyperbolas and shifted")


def _vanishes(a: Matrix) -> bool:
    return all(e == 0 for row in a for e in row)


def _product(ring: Ring, a: Matrix, b: Matrix) -> Matrix:
    n = len(a)
    product = [[ring.tower.combine(a[i][k] * b[k][j] for k in range(n)) for j in range(n)] for i in range(n)]
    return [[ring.tower.zero if ring.tower.is_zero(e) else e for e in row] for row in product]


def _image(ring: Ring, a: Matrix, w: Sequence[Poly]) -> list[Poly]:
    return [ring.tower.combine(e * v for e, v in zip(row, w, strict=True)) for row in a]


def _ratio(ring: Ring, a: Matrix, b: Matrix, guess: Matrix) -> Poly | None:
    """Return d with a = d·b, or None if the ring contains no such d.

    If cancelled reciprocals hide d from the division, d is on the diagonal of ``guess``.
    """
    pairs = [(x, y) for left, right in zip(a, b, strict=True) for x, y in zip(left, right, strict=True)]
    if any(x != 0 and y == 0 for x, y in pairs):
        return None
    divided = [divmod(x, y) for x, y in pairs if y != 0]
    candidates = [quotient for quotient, remainder in divided if remainder == 0][:1]
    candidates += [guess[i][i] for i in range(len(guess)) if guess[i][i] != 0]
    return next((d for d in candidates if all(ring.tower.is_zero(x - d * y) for x, y in pairs)), None)


def _quotients(ring: Ring, elements: Sequence[Poly], divisor: Poly) -> list[Expression] | None:
    """Return the elements divided by the divisor; None unless all quotients are in the ring."""
    divided = [divmod(e, divisor) for e in elements]
    return (
        None
        if any(remainder != 0 for _, remainder in divided)
        else [ring.expression(quotient) for quotient, _ in divided]
    )


@dataclass(frozen=True)
class _Root:
    """The root of c = ±(scale·element)²; ``positive`` is true for the sign +."""

    positive: bool
    scale: Expression
    element: Poly


def _root(ring: Ring, c: Poly) -> _Root | None:
    """Return the square root of c or of −c, if it is an element of the ring times the root of a number; else None."""
    content, factors = c.factor()
    if any(multiplicity % 2 for _, multiplicity in factors):
        return None
    element = ring.tower.constant(1)
    for factor, multiplicity in factors:
        element *= factor ** (int(multiplicity) // 2)
    value = rational(content)
    return _Root(value > 0, _square_root(abs(value)), element)


def _square_root(value: Fraction) -> Expression:
    top, bottom = isqrt(value.numerator), isqrt(value.denominator)
    return (
        number(Fraction(top, bottom))
        if top**2 == value.numerator and bottom**2 == value.denominator
        else sqrt(number(value))
    )
