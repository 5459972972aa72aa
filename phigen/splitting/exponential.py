"""exp(tA)w − w in closed form, for the linear equations ẇ = Aw of `phigen.splitting.closure`.

The closed forms rest on the relation that the powers of A satisfy; A commutes with its entries, which are constant:

- A^k = 0: a polynomial in t
- A² = dA: (e^{td} − 1) A/d, without cancellation
- A³ = −e²A: sin(te) A/e + (1 − cos(te)) A²/e²
- A³ = e²A: 2s(c A/e + s A²/e²) with s = sinh(te/2), c = cosh(te/2)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from phigen.splitting.closure import LinearMotion
from phigen.splitting.ring import TIME, Ring
from phigen.symbolic.expression import Expression, call, number, sqrt
from phigen.symbolic.tower import Poly, rational

Matrix = Sequence[Sequence[Poly]]


class NoClosedFormError(Exception):
    """No closed form is known; the text says of what."""


@dataclass(frozen=True)
class Solution:
    """The increments of the coordinates of a linear motion, and what they do, in a word."""

    increments: tuple[Expression, ...]
    manner: str


def solve(ring: Ring, motion: LinearMotion) -> Solution:
    """exp(tA)w − w for the coordinates of the motion. Raises `NoClosedFormError`."""
    a, n = motion.matrix, len(motion.coordinates)
    w = [ring.monomial(m) for m in motion.basis]
    if len(w) == 1:
        growth = ring.expression(a[0][0] * ring.tower.variable(TIME))
        return Solution((ring.expression(w[0]) * call("expm1", growth),), "scaled")
    powers = [a, _product(ring, a, a)]
    found = _nilpotent(ring, powers, w)
    if found is None:
        found = _scaling(ring, powers, w) or _turning(ring, powers, w)
    if found is None:
        raise NoClosedFormError(
            f"exp(tA) for a {len(w)}×{len(w)} matrix A that satisfies neither A^k = 0 nor A² = dA nor A³ = -cA"
        )
    return Solution(found.increments[:n], found.manner)


def _nilpotent(ring: Ring, powers: list[Matrix], w: Sequence[Poly]) -> Solution | None:
    """Σ t^k A^k w/k!, if some power of A vanishes. Powers that were needed are kept in the list."""
    tower, t = ring.tower, ring.tower.variable(TIME)
    total, power, factorial = [tower.zero] * len(w), powers[0], 1
    for k in range(1, len(w) + 1):
        factorial *= k
        scale = t**k * tower.constant(Fraction(1, factorial))
        total = [tower.combine([s, scale * image]) for s, image in zip(total, _image(ring, power, w), strict=True)]
        power = powers[k] if k < len(powers) else _product(ring, power, powers[0])
        if all(e == 0 for row in power for e in row):
            manner = "shifted" if k == 1 else "moved by a polynomial in t"
            return Solution(tuple(ring.expression(s) for s in total), manner)
        if k == 3 and len(powers) == 2:
            powers.append(power)
    return None


def _scaling(ring: Ring, powers: list[Matrix], w: Sequence[Poly]) -> Solution | None:
    """(e^{td} − 1) (A/d) w, if A² = dA."""
    d = _ratio(ring, powers[1], powers[0])
    if d is None:
        return None
    directed = [_quotient(ring, image, d) for image in _image(ring, powers[0], w)]
    growth = call("expm1", ring.expression(d * ring.tower.variable(TIME)))
    return Solution(tuple(growth * _settled(ring, e) for e in directed), "scaled")


def _turning(ring: Ring, powers: list[Matrix], w: Sequence[Poly]) -> Solution | None:
    """sin(te) (A/e)w + (1 − cos te) (A/e)²w, if A³ = −e²A; the hyperbolic functions, if A³ = e²A."""
    cube = powers[2] if len(powers) > 2 else _product(ring, powers[1], powers[0])
    c = _ratio(ring, cube, powers[0])
    root = None if c is None else _root(ring, c)
    if root is None:
        return None
    turns, content, e = root
    scale = sqrt(number(content))
    angle = scale * ring.expression(e * ring.tower.variable(TIME))
    first = [_settled(ring, _quotient(ring, v, e)) / scale for v in _image(ring, powers[0], w)]
    second = [_settled(ring, _quotient(ring, v, e * e)) / number(content) for v in _image(ring, powers[1], w)]
    if turns:
        sine, rest = call("sin", angle), call("versin", angle)
        return Solution(tuple(sine * a + rest * b for a, b in zip(first, second, strict=True)), "turned")
    s, c = (call(f, angle / 2) for f in ("sinh", "cosh"))
    increments = tuple(2 * s * (c * a + s * b) for a, b in zip(first, second, strict=True))
    return Solution(increments, "moved along hyperbolas")


def _product(ring: Ring, a: Matrix, b: Matrix) -> Matrix:
    n = len(a)
    product = [[ring.tower.combine(a[i][k] * b[k][j] for k in range(n)) for j in range(n)] for i in range(n)]
    return [[ring.tower.zero if ring.tower.is_zero(e) else e for e in row] for row in product]


def _image(ring: Ring, a: Matrix, w: Sequence[Poly]) -> list[Poly]:
    return [ring.tower.combine(e * v for e, v in zip(row, w, strict=True)) for row in a]


def _ratio(ring: Ring, a: Matrix, b: Matrix) -> Poly | None:
    """d with a = d·b, if there is one in the ring."""
    pairs = [(x, y) for left, right in zip(a, b, strict=True) for x, y in zip(left, right, strict=True)]
    if any(x != 0 and y == 0 for x, y in pairs):
        return None
    top, bottom = next((x, y) for x, y in pairs if y != 0)
    d, rest = divmod(top, bottom)
    if rest != 0 or any(not ring.tower.is_zero(x - d * y) for x, y in pairs):
        return None
    return d


def _quotient(ring: Ring, element: Poly, divisor: Poly) -> Poly | None:
    """element/divisor, if it is in the ring."""
    quotient, rest = divmod(element, divisor)
    return quotient if rest == 0 else None


def _settled(ring: Ring, element: Poly | None) -> Expression:
    if element is None:
        raise NoClosedFormError("exp(tA) with a quotient that may be 0/0")
    return ring.expression(element)


def _root(ring: Ring, c: Poly) -> tuple[bool, Fraction, Poly] | None:
    """(turns, content, e) with c = −content·e² if it turns, content·e² if not, content > 0; None if c is no square."""
    content, factors = c.factor()
    if any(multiplicity % 2 for _, multiplicity in factors):
        return None
    e = ring.tower.constant(1)
    for factor, multiplicity in factors:
        e *= factor ** (int(multiplicity) // 2)
    value = rational(content)
    return value < 0, abs(value), e
