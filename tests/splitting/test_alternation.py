"""Coefficients of splitting methods: order conditions for any number of parts, and the flows of a step."""

from fractions import Fraction
from itertools import pairwise, product
from math import factorial

import pytest

from phigen.scheme.alternation import ALTERNATIONS, find, orders, schedule

#: Tolerance of order conditions: published coefficients have at least 15 digits.
TOLERANCE = 1e-14


def word_coefficients(flows, parts, degree):
    """Return the coefficients of the words of at most ``degree`` letters in exp(t_n A_n) … exp(t_1 A_1), where the A_i
    do not commute.
    """
    words = {(): 1.0}
    for part, time in flows:
        longer = {}
        for word, value in words.items():
            for k in range(degree - len(word) + 1):
                extended = word + (part,) * k
                longer[extended] = longer.get(extended, 0.0) + value * time**k / factorial(k)
        words = longer
    return words


def defects(method, parts, degree):
    """Return, for each degree, the largest difference from exp(A_1 + … + A_m)."""
    steps = schedule(method, parts)
    coefficients = word_coefficients([(part, steps.times[row]) for part, row in steps.flows], parts, degree)
    words = {d: product(range(parts), repeat=d) for d in range(1, degree + 1)}
    return {d: max(abs(coefficients.get(w, 0.0) - 1 / factorial(d)) for w in listed) for d, listed in words.items()}


CASES = [(m, 2) for m in ALTERNATIONS if m.order <= 8] + [(m, 3) for m in ALTERNATIONS if m.order <= 6]


@pytest.mark.parametrize(("method", "parts"), CASES, ids=lambda c: f"{c.name}-{c.order}" if hasattr(c, "name") else c)
def test_order_conditions_hold_up_to_the_order_and_not_beyond(method, parts):
    residuals = defects(method, parts, method.order + 1)
    assert max(residuals[d] for d in range(1, method.order + 1)) < TOLERANCE
    assert residuals[method.order + 1] > 1e-7


@pytest.mark.parametrize("method", ALTERNATIONS, ids=lambda m: f"{m.name}-{m.order}")
def test_coefficients_are_a_palindrome_and_sum_to_one(method):
    assert method.fractions == method.fractions[::-1]
    assert abs(sum(method.fractions) - 1) < Fraction(1, 10**15)


@pytest.mark.parametrize("parts", [2, 3, 5])
@pytest.mark.parametrize("method", ALTERNATIONS, ids=lambda m: f"{m.name}-{m.order}")
def test_flows_of_a_step_are_the_same_backwards_and_no_two_neighbours_are_of_one_part(method, parts):
    steps = schedule(method, parts)
    flows = [(part, steps.times[row]) for part, row in steps.flows]
    assert flows == flows[::-1]
    assert all(a != b for (a, _), (b, _) in pairwise(flows))
    assert len(flows) == 2 * (parts - 1) * method.stages + 1
    for part in range(parts):
        assert sum(t for p, t in flows if p == part) == pytest.approx(1, abs=1e-14)


def test_one_part_is_followed_exactly():
    assert [(part, schedule(find("auto", 6), 1).times[row]) for part, row in schedule(find("auto", 6), 1).flows] == [
        (0, 1)
    ]


def test_names_offer_their_orders():
    assert orders("auto") == [2, 4, 6, 8, 10]
    assert (orders("none"), orders("blanes-moan"), orders("kahan-li")) == ([2], [4, 6], [6, 8])
    assert find("suzuki", 6) is None
