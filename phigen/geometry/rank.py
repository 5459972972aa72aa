"""Generic rank of a matrix of expressions: the rank at sample points with rational coordinates, modulo primes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from fractions import Fraction
from typing import Any

from flint import nmod_mat

from phigen.symbolic.expression import Expression, symbols_of
from phigen.symbolic.numeric import DomainError, evaluate_exactly, evaluate_with_scale, is_rational
from phigen.symbolic.verdict import DIGITS, ZERO_DIGITS, sample_point

#: Number of points at which the rank is computed; the largest of these ranks is the result.
POINTS = 3
ATTEMPTS = 64
#: Primes modulo which ranks are computed. A rank modulo a prime is never larger than the rank over Q, and it is smaller
#: only for few primes. So the larger one of the two ranks is taken.
PRIMES = (2**61 - 1, 2**63 - 25)

Rows = Sequence[Sequence[Expression]]


def generic_ranks(matrices: Sequence[Rows], positive: Collection[str] = ()) -> list[int] | None:
    """Return the rank of each matrix at generic points; None if no point was found at which all entries have
    values.

    The rank at a point is never larger than the generic rank, and it is smaller at exceptional points only. So the
    result is the largest rank at `POINTS` points. If entries are not rational functions, they are evaluated to `DIGITS`
    digits.
    """
    roots = [e for m in matrices for row in m for e in row]
    names, exact = symbols_of(*roots), is_rational(*roots)
    rank: Callable[[Any], int] = _exact_rank if exact else _numerical_rank
    ranks_at_points: list[list[int]] = []
    for k in range(ATTEMPTS):
        point = sample_point(names, positive, k)
        values: list[Any]
        try:
            values = evaluate_exactly(roots, point) if exact else evaluate_with_scale(roots, point, DIGITS)
            in_turn = iter(values)
            ranks_at_points.append([rank([[next(in_turn) for _ in row] for row in m]) for m in matrices])
        except DomainError:
            continue
        if len(ranks_at_points) == POINTS or not names:  # without symbols, one point is enough
            break
    return [max(ranks) for ranks in zip(*ranks_at_points, strict=True)] if ranks_at_points else None


def _exact_rank(rows: Sequence[Sequence[Fraction]]) -> int:
    if not rows or not rows[0]:
        return 0
    ranks = []
    for prime in PRIMES:
        with suppress(ValueError):  # raised if the prime divides a denominator
            ranks.append(int(nmod_mat(len(rows), len(rows[0]), _residues(rows, prime), prime).rank()))
    if not ranks:
        raise DomainError("the rank is not known, since all primes in use divide denominators")
    return max(ranks)


def _residues(rows: Sequence[Sequence[Fraction]], prime: int) -> list[int]:
    return [v.numerator * (1 if v.denominator == 1 else pow(v.denominator, -1, prime)) % prime for r in rows for v in r]


def _numerical_rank(rows: Sequence[Sequence[tuple[Any, Any]]]) -> int:
    """Return the rank of a matrix by elimination with full pivoting. An entry is a pair (value, scale).

    The scale is the largest absolute value of an intermediate result in the computation of the value. Values that are
    tiny relative to the largest scale count as 0.
    """
    left = [[value for value, _ in row] for row in rows]
    threshold = max((scale for row in rows for _, scale in row), default=1) * 10**-ZERO_DIGITS
    rank = 0
    while left and left[0]:
        size, r, c = max((abs(v), r, c) for r, row in enumerate(left) for c, v in enumerate(row))
        if size <= threshold:
            break
        rank += 1
        pivot = left.pop(r)
        left = [
            [v - row[c] / pivot[c] * w for k, (v, w) in enumerate(zip(row, pivot, strict=True)) if k != c]
            for row in left
        ]
    return rank
