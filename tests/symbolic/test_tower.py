"""The differential ring: it refuses products that exceed the memory, and cancels reciprocals."""

from fractions import Fraction

import pytest

from phigen.symbolic.expression import call, power, symbol, total
from phigen.symbolic.numeric import evaluate
from phigen.symbolic.tower import Tower

NAMES = [f"x{i}" for i in range(10)]


def test_powers_and_products_larger_than_memory_are_refused_before_they_are_made():
    ring = Tower(NAMES)
    every = ring.convert(total(map(symbol, NAMES)))
    with pytest.raises(OverflowError):
        ring.integer_power(every, 60)
    large = ring.integer_power(every, 6)
    with pytest.raises(OverflowError):
        ring.product(large, large)
    one = ring.integer_power(ring.convert(symbol("x0") + 1), 1000)
    assert len(one) == 1001


@pytest.mark.parametrize(("up", "down", "left"), [(1, 1, 0), (5, 3, 2), (3, 5, -2), (37, 100, -63)])
def test_a_variable_and_its_reciprocal_cancel(up, down, left):
    x = symbol("x0")
    ring = Tower(NAMES, [1 / x, call("exp", x)])
    v, w = ring.convert(x), ring.convert(1 / x)
    rest = ring.convert(call("exp", x))
    assert ring.cancelled(v**up * w**down * rest + w) == ring.convert(power(x, left)) * rest + w


def test_a_root_found_after_the_reciprocal_of_its_square_stands_for_it():
    """If √q appears after 1/q, the ring writes 1/q by the root, also where 1/q occurs inside another reciprocal. The
    value stays the same.
    """
    x, y = symbol("x"), symbol("y")
    q = 1 + x**2
    e = 1 / (power(q, Fraction(1, 2)) + 2 * (y / q)) * (1 + y * (power(q, Fraction(-3, 2)) * (x * (1 + q))))
    tower = Tower(["x", "y"], [e])
    in_tower, expected = (float(v) for v in evaluate([tower.expression(tower.convert(e)), e], {"x": 0.3, "y": 0.7}))
    assert in_tower == pytest.approx(expected, rel=1e-14)
