"""Unrolled Gaussian elimination for matrices with a known pattern of zeros."""

import mpmath
import numpy as np
import pytest
from support import values

from phigen.scheme.elimination import elimination, factorise, operations, pivot_order, transposed_elimination
from phigen.scheme.lowering import cost
from phigen.symbolic.expression import symbol
from phigen.symbolic.numeric import evaluate
from phigen.symbolic.symbols import Symbol


def ring(n):
    """Return the pattern (n, n) of the entries that are not 0 for a ring, in which each index is coupled to its two
    neighbours.
    """
    return [[(i - j) % n in (0, 1, n - 1) for j in range(n)] for i in range(n)]


def star(n):
    """Return the pattern (n, n) of the entries that are not 0 for a star, in which index 0 is coupled to all others."""
    return [[0 in (i, j) or i == j for j in range(n)] for i in range(n)]


def one_sided(n):
    return [[j in (i, (3 * i + 1) % n, (5 * i + 2) % n) for j in range(n)] for i in range(n)]


PATTERNS = {"full": [[True] * 4] * 4, "ring": ring(9), "star": star(8), "one-sided": one_sided(11), "one": [[True]]}


def entry(i, j):
    return (i == j) + mpmath.mpf((3 * i - 5 * j + i * j) % 7 + 1) / 41


@pytest.mark.parametrize("name", PATTERNS)
def test_elimination_solves_linear_systems(name):
    pattern = PATTERNS[name]
    n = len(pattern)
    with mpmath.workdps(30):
        matrix = mpmath.matrix(n, n)
        for i in range(n):
            for j in range(n):
                matrix[i, j] = entry(i, j) if pattern[i][j] else 0
        side = mpmath.matrix([mpmath.mpf(2 * i - 3) / 7 for i in range(n)])
        at = {Symbol("J", i, j): matrix[i, j] for i in range(n) for j in range(n) if pattern[i][j]}
        at |= {Symbol("r", i): side[i] for i in range(n)}
        solution, reciprocals = elimination(pattern)
        computed = mpmath.matrix(values(solution, at))
        assert mpmath.norm(matrix * computed - side) < mpmath.mpf(10) ** -25
        pivots = mpmath.mpf(1)
        for r in values(reciprocals, at):
            pivots /= r
        assert mpmath.almosteq(pivots, mpmath.det(matrix), mpmath.mpf(10) ** -25)


@pytest.mark.parametrize("name", PATTERNS)
def test_factors_solve_as_elimination_does(name):
    factors = factorise(PATTERNS[name])
    n = len(PATTERNS[name])
    at = {Symbol("J", i, j): float(entry(i, j)) for i in range(n) for j in range(n)}
    at |= {Symbol("r", i): i - 2.5 for i in range(n)}
    factor_values = dict(
        zip([str(e.value) for e in factors.named("f").values], evaluate(list(factors.values), at), strict=True)
    )
    side = [symbol(Symbol("r", i)) for i in range(n)]
    assert evaluate(factors.named("f").solved(side), at | factor_values) == pytest.approx(
        evaluate(elimination(PATTERNS[name])[0], at), rel=1e-13
    )


@pytest.mark.parametrize("name", PATTERNS)
def test_transposed_elimination_solves_with_the_transpose_and_by_the_same_pivots(name):
    pattern = PATTERNS[name]
    n = len(pattern)
    matrix = np.array([[float(entry(i, j)) * pattern[i][j] for j in range(n)] for i in range(n)])
    at = {Symbol("J", i, j): matrix[i, j] for i in range(n) for j in range(n)}
    at |= {Symbol("r", i): i - 2.5 for i in range(n)}
    solution, reciprocals = transposed_elimination(pattern)
    assert matrix.T @ evaluate(solution, at) == pytest.approx(np.arange(n) - 2.5, abs=1e-12)
    assert evaluate(list(reciprocals), at) == evaluate(list(elimination(pattern)[1]), at)


@pytest.mark.parametrize("name", PATTERNS)
def test_operations_are_counted_before_they_are_made(name):
    solved = factorise(PATTERNS[name]).solved([symbol(Symbol("r", i)) for i in range(len(PATTERNS[name]))])
    assert operations(PATTERNS[name]) == cost(solved)


def test_the_centre_of_a_star_is_the_last_pivot_and_nothing_fills_in():
    """With the centre as first pivot, elimination would couple all other indices, and L and U would have 56 entries
    instead of 14.
    """
    factors = factorise(star(8))
    assert pivot_order(star(8))[-2:] in ([0, 7], [7, 0])
    assert len(factors.lower) + len(factors.upper) == 14


def test_on_a_ring_only_what_closes_it_fills_in():
    factors = factorise(ring(30))
    assert len(factors.lower) + len(factors.upper) <= 4 * 30
