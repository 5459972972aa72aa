"""Generic rank of matrices of expressions."""

from fractions import Fraction

from phigen.geometry import rank
from phigen.geometry.rank import POINTS, PRIMES, generic_ranks
from phigen.symbolic.expression import ONE, ZERO, call, number, sqrt, symbol
from phigen.symbolic.verdict import sample_point

x, y = symbol("x"), symbol("y")


def test_an_unlucky_point_does_not_lower_the_rank():
    zero_there = x - number(sample_point(["x"], [], 0)["x"])
    assert generic_ranks([[[zero_there, ZERO], [ZERO, ONE]]]) == [2]


def test_functions_are_evaluated_far_beyond_double_precision():
    # sin² + cos² − 1 only has values of the size of rounding errors and counts as 0. 1e-30·exp(x) does not.
    zero = call("sin", x) ** 2 + call("cos", x) ** 2 - 1
    assert generic_ranks([[[zero, ONE], [ZERO, ONE]], [[call("exp", x) / 10**30, ZERO], [ZERO, ONE]]]) == [1, 2]


def test_points_outside_the_domain_are_skipped():
    assert generic_ranks([[[sqrt(x - 1) * call("log", y - 2)]]]) == [1]
    assert generic_ranks([[[sqrt(-(x**2))]]]) is None


def test_empty_matrices_have_rank_zero():
    assert generic_ranks([[], [[x]]]) == [0, 1]


def test_neither_multiples_of_a_prime_nor_denominators_with_it_lower_the_rank():
    for prime in PRIMES:
        assert generic_ranks([[[number(prime), ZERO], [ZERO, x / prime]]]) == [2]
    assert generic_ranks([[[number(Fraction(1, PRIMES[0] * PRIMES[1]))]]]) is None


def test_constant_matrices_are_evaluated_once(monkeypatch):
    """Constant matrices are evaluated at one point only. The gradients of linear Casimirs are constant, and large
    algebras have hundreds of them.
    """
    points = []
    monkeypatch.setattr(rank, "sample_point", lambda *arguments: points.append(1) or sample_point(*arguments))
    for entry, times in ((ONE, 1), (x, POINTS)):
        points.clear()
        assert generic_ranks([[[entry]]]) == [1]
        assert len(points) == times
