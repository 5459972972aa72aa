"""Recognition of polynomials that are written as other functions.

Examples are x·(sin(y)**2 + cos(y)**2) and (x**2 - 1)/(x - 1).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import comb

from phigen.symbolic.expression import Expression, gradient, number, substitute, symbol, symbols_of, total
from phigen.symbolic.numeric import DomainError, evaluate_precisely, evaluate_with_scale
from phigen.symbolic.tower import Tower
from phigen.symbolic.verdict import DIGITS, ZERO_DIGITS, sample_point

#: Largest degree of the polynomials that `polynomial_by_identity` finds. The entries of constant, linear and
#: log-canonical tensors π have degree ≤ 2.
DEGREE = 2
#: Each pair (a, b) stands for the point (a, a + b, a + 2b, …). `_expansion` takes the first of these points at which
#: the expression has a Taylor polynomial. Many functions have rational values at the first two points.
_BASES = ((0, 0), (1, 0), (2, 1))
#: An expression is evaluated at points of a line, to exclude functions that are not polynomials. If it has no value at
#: one of the points, another line is tried; this is the largest number of lines.
_LINES = 8


def polynomial_by_identity(e: Expression, coordinates: Sequence[str]) -> Expression | None:
    """Return the polynomial of degree ≤ `DEGREE` in the coordinates that equals an expression; None if there is
    none.

    The coefficients of the polynomial are Taylor coefficients of the expression at a point. The equality is then proved
    in the ring of the functions that occur; without a proof, the result is None.
    """
    moving = [c for c in symbols_of(e) if c in coordinates]
    if not _flat_on_a_line(e, moving):
        return None
    try:
        candidate = _expansion(e, moving)
        if candidate is None:
            return None
        tower = Tower(symbols_of(e, candidate), [e - candidate])
        return candidate if tower.is_zero(tower.convert(e - candidate)) else None
    except (OverflowError, ZeroDivisionError):
        return None


def _flat_on_a_line(e: Expression, moving: Sequence[str]) -> bool:
    """Whether the finite difference of order `DEGREE` + 1 along a line is 0, as for a polynomial of degree ≤ `DEGREE`.

    This test is cheap, and excludes nearly all functions that are not polynomials. ``moving`` are the coordinates in
    ``e``.
    """
    names = symbols_of(e)
    for k in range(_LINES):
        start = sample_point(names, names, k)
        direction = {c: start[c] / (7 + i) for i, c in enumerate(moving)}
        values = []
        try:
            for t in range(DEGREE + 2):
                point = start | {c: start[c] + t * v for c, v in direction.items()}
                values += evaluate_with_scale([e], point, DIGITS)
        except DomainError:
            continue
        difference = sum((-1) ** t * comb(DEGREE + 1, t) * value for t, (value, _) in enumerate(values))
        return bool(abs(difference) < max(scale for _, scale in values) * 10**-ZERO_DIGITS)
    return False


def _expansion(e: Expression, moving: Sequence[str]) -> Expression | None:
    """Return the Taylor polynomial of degree 2 at the first point of `_BASES` where it exists; None if there is
    none."""
    slopes = gradient(e, moving)
    parts = [e, *slopes, *(c for slope in slopes for c in gradient(slope, moving))]
    parameters = [s for s in symbols_of(e) if s not in moving]
    for first, step in _BASES:
        base = {c: Fraction(first + k * step) for k, c in enumerate(moving)}
        at_base = [_simplified(v) for v in _values_at(parts, base, parameters)]
        if at_base:
            d = [symbol(c) - v for c, v in base.items()]
            directions = [number(1), *d, *(a * b / 2 for a in d for b in d)]
            return total(value * direction for value, direction in zip(at_base, directions, strict=True))
    return None


def _values_at(
    parts: Sequence[Expression], base: Mapping[str, Fraction], parameters: Sequence[str]
) -> list[Expression]:
    """Return the expressions at the point ``base`` of the coordinates; [] if one of them has no value there."""
    try:
        evaluate_precisely(parts, {**sample_point(parameters, parameters, 0), **base}, DIGITS)
    except DomainError:
        return []
    return substitute(parts, {c: number(v) for c, v in base.items()})


def _simplified(e: Expression) -> Expression:
    tower = Tower(symbols_of(e), [e])
    return tower.expression(tower.simplified(tower.convert(e)))
