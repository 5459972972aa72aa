"""The increments exp(tA)w − w of the solution of linear equations ẇ = Aw, in closed form.

A closed form exists if powers of A satisfy one of these relations, in which c and d are constant along the flow:

- A^k = 0: the solution is a polynomial in t.
- A^{a+1} = dA^a: exp(tA) = Σ_{k<a} (tA)^k/k! + A^a/d^a Σ_{k≥a} (td)^k/k!.
- A^{a+2} = −cA^a for a = 1 or 2: a similar formula, with sin and cos of t√c, or with sinh and cosh.

If c or d depends on the state, a quotient by c or d may be 0/0 at states where c or d vanishes. Then entire functions
of `phigen.symbolic.entire` take the place of the quotients. The functions of ct² are valid for both signs of c.
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

#: Largest number of powers A, A², … of a matrix that are computed; all powers of a matrix with 64 rows would take
#: minutes.
MOST_POWERS = 16

#: Description of a motion at a constant rate, for reports.
SHIFTED = "shifted"

_HALF = number(Fraction(1, 2))


class NoClosedFormError(Exception):
    """Raised if no closed form of exp(tA) is known; the text describes the matrix A."""


@dataclass(frozen=True)
class Solution:
    """The increments of the coordinates of a linear motion, and ``manner``, a word for reports that describes the
    motion."""

    increments: tuple[Expression, ...]
    manner: str


def solve(ring: Ring, motion: LinearMotion) -> Solution:
    """Return the increments exp(tA)w − w of the coordinates of a linear motion. Raises `NoClosedFormError`."""
    w = [ring.monomial(m) for m in motion.basis]
    if len(w) == 1:
        growth = ring.expression(motion.matrix[0][0] * ring.tower.variable(TIME))
        return Solution((ring.expression(w[0]) * call("expm1", growth),), "multiplied by a factor")
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
    """Return the powers A, A², … of a matrix, up to the first power that vanishes.

    If no power vanishes, the number of powers is the number of rows, but at least 4 and at most `MOST_POWERS`.
    """
    powers = [a]
    while len(powers) < max(4, min(len(a), MOST_POWERS)) and not _vanishes(powers[-1]):
        powers.append(_product(ring, powers[-1], a))
    return powers


def _nilpotent(ring: Ring, powers: Sequence[Matrix], images: Sequence[Sequence[Poly]]) -> Solution | None:
    """Return the increments Σ_{k≥1} t^k A^k w/k! of the solution of ẇ = Aw if a power of A vanishes, else None.

    ``powers`` are A, A², …, and ``images`` are Aw, A²w, …
    """
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
    """Return the increments exp(tA)w − w of the solution of ẇ = Aw if A^{a+1} = dA^a for some d, else None.

    ``powers`` are A, A², …, and ``images`` are Aw, A²w, …
    """
    d = _ratio(ring, powers[a], powers[a - 1], powers[0])
    if d is None:
        return None
    t, exponent = symbol(TIME), ring.expression(d * ring.tower.variable(TIME))
    directed = _quotients(ring, images[a - 1], d**a)
    if directed is not None:
        growth = call("expm1", exponent)
        if a == 1:
            return Solution(tuple(growth * v for v in directed), "multiplied by a factor")
        first = [ring.expression(v) for v in images[0]]
        return Solution(
            tuple(t * u + (growth - exponent) * v for u, v in zip(first, directed, strict=True)), "scaled and shifted"
        )
    if a == 2:
        return None
    growth = t * call("exprel", exponent)
    return Solution(tuple(growth * ring.expression(v) for v in images[0]), "multiplied by a factor")


def _turning(ring: Ring, powers: Sequence[Matrix], images: Sequence[Sequence[Poly]], a: int) -> Solution | None:
    """Return the increments exp(tA)w − w of the solution of ẇ = Aw if A^{a+2} = −cA^a for some c, else None.

    ``powers`` are A, A², …, and ``images`` are Aw, A²w, …
    """
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
    """Return the increments exp(tA)w − w of the solution of ẇ = Aw with A^{a+2} = −cA^a, without dividing by c.

    The increments are computed by entire functions of s = ct². sin and 1 − cos of the angle √s are computed from
    functions of half the angle.
    """
    t, s = symbol(TIME), ring.expression(c * ring.tower.variable(TIME) ** 2)
    if a == 1:
        return _solution_of_scaled_matrix(ring, matrix, images, s)
    first, second, third = ([ring.expression(v) for v in image] for image in images[:3])
    speed = t * call("sinroot", s / 4)
    versine, arc_rest = _HALF * speed**2, t**3 * call("arcroot", s)
    increments = tuple(t * u + (versine * v + arc_rest * w) for u, v, w in zip(first, second, third, strict=True))
    return Solution(increments, "rotated and shifted")


def _solution_of_scaled_matrix(ring: Ring, matrix: Matrix, images: Sequence[Sequence[Poly]], s: Expression) -> Solution:
    """Return the increments exp(tA)w − w of the solution of ẇ = Aw with A³ = −cA, by entire functions of ``s``
    = ct².

    A is written as fM with a factor f that does not depend on the state, and f multiplies the time. M²w is computed in
    the cheaper of two ways: from the entries of M², or as M times Mw, which is cheaper for cross products.
    """
    factor = _static_factor(ring, matrix)
    once = [ring.expression(v / factor) for v in images[0]]
    twice = [ring.expression(v / factor**2) for v in images[1]]
    rows = [[ring.expression(e / factor) for e in row] for row in matrix]
    second_images = [total(e * v for e, v in zip(row, once, strict=True)) for row in rows]
    twice = min(twice, second_images, key=lambda entries: len(list(topological(entries))))
    speed = symbol(TIME) * ring.expression(factor) * call("sinroot", s / 4)
    sine, versine = speed * call("cosroot", s / 4), _HALF * speed**2
    return Solution(tuple(sine * u + versine * v for u, v in zip(once, twice, strict=True)), "rotated")


def _static_factor(ring: Ring, a: Matrix) -> Poly:
    """Return the greatest common factor of all entries of a matrix; 1 if this factor depends on the state."""
    factor = reduce(lambda x, y: x.gcd(y), [e for row in a for e in row if e != 0])
    return ring.tower.constant(1) if ring.support(factor) else factor


def _circular(
    first: Sequence[Expression], units: Sequence[Sequence[Expression]], angle: Expression, a: int
) -> Solution:
    """Return the increments exp(tA)w − w of the solution of ẇ = Aw with A^{a+2} = −ω²A^a, for a = 1 or 2.

    Let θ = ωt be the ``angle``. The matrix exp(tA) − 1 is sin(θ)A/ω + (1 − cos θ)A²/ω² for a = 1, and tA + (1 − cos
    θ)A²/ω² + (θ − sin θ)A³/ω³ for a = 2. ``first`` is Aw. ``units`` are the vectors A^k w/ω^k that these formulas
    contain: for k = 1 and 2 if a = 1, for k = 2 and 3 if a = 2.
    """
    sine, versine = call("sin", angle), call("versin", angle)
    if a == 1:
        return Solution(tuple(sine * u + versine * v for u, v in zip(*units, strict=True)), "rotated")
    difference, t = angle - sine, symbol(TIME)
    increments = tuple(t * f + (versine * u + difference * v) for f, u, v in zip(first, *units, strict=True))
    return Solution(increments, "rotated and shifted")


def _hyperbolic(
    first: Sequence[Expression], units: Sequence[Sequence[Expression]], angle: Expression, a: int
) -> Solution:
    """Return the increments exp(tA)w − w of the solution of ẇ = Aw with A^{a+2} = ω²A^a, for a = 1 or 2.

    The arguments are those of `_circular`. Its formulas hold with three replacements: sinh θ for sin θ, cosh θ − 1 for
    1 − cos θ, and sinh θ − θ for θ − sin θ. cosh θ − 1 is computed as 2 sinh²(θ/2).
    """
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
    """Return d with a = d·b for two matrices a and b, or None if the ring contains no such d.

    d is found by polynomial division of an entry of a by an entry of b. If reciprocals have been cancelled in the
    entries, the division may leave a remainder. Therefore the diagonal entries of the matrix ``guess`` are also tried
    as d.
    """
    pairs = [(x, y) for left, right in zip(a, b, strict=True) for x, y in zip(left, right, strict=True)]
    if any(x != 0 and y == 0 for x, y in pairs):
        return None
    divided = [divmod(x, y) for x, y in pairs if y != 0]
    candidates = [quotient for quotient, remainder in divided if remainder == 0][:1]
    candidates += [guess[i][i] for i in range(len(guess)) if guess[i][i] != 0]
    return next((d for d in candidates if all(ring.tower.is_zero(x - d * y) for x, y in pairs)), None)


def _quotients(ring: Ring, elements: Sequence[Poly], divisor: Poly) -> list[Expression] | None:
    """Return the elements, each divided by the ``divisor``, as expressions; None unless the ring contains all
    quotients.
    """
    divided = [divmod(e, divisor) for e in elements]
    return (
        None
        if any(remainder != 0 for _, remainder in divided)
        else [ring.expression(quotient) for quotient, _ in divided]
    )


@dataclass(frozen=True)
class _Root:
    """A polynomial c written as ±(scale·element)²; ``positive`` says that the sign is +."""

    positive: bool
    scale: Expression
    element: Poly


def _root(ring: Ring, c: Poly) -> _Root | None:
    """Return c as ±(scale·element)²; None if c does not have this form. The scale is the square root of a number."""
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
