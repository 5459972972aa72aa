"""Evaluation of expressions in floats, fractions and many digits."""

import math
from fractions import Fraction

import pytest

from phigen.symbolic.elliptic import THIRD
from phigen.symbolic.expression import PI, call, power, sqrt, symbol
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.numeric import (
    DomainError,
    evaluate,
    evaluate_exactly,
    evaluate_precisely,
    evaluate_with_scale,
    is_rational,
)
from phigen.symbolic.universal import ANOMALY

x, y = symbol("x"), symbol("y")


@pytest.mark.parametrize("name", sorted({*FUNCTIONS} - {ANOMALY}))
def test_every_function_agrees_between_floats_and_mpmath(name):
    at = {"x": 1.25, "y": 0.75} if name in ("acosh", "atan2", "power") else {"x": 0.375, "y": 0.75}
    fourth = -y if name == THIRD else x + y
    e = call(name, *[x, y, x - y, fourth, y][: FUNCTIONS[name].arity])
    (value,) = evaluate([e], at)
    (precise,) = evaluate_precisely([e], {k: Fraction(v) for k, v in at.items()})
    assert value == pytest.approx(float(precise), rel=1e-15)


def test_precise_values_have_the_digits_asked_for():
    (value,) = evaluate_precisely([PI], {}, digits=60)
    assert str(value).startswith("3.14159265358979323846264338327950288419716939937510")


def test_global_precision_of_mpmath_is_left_alone():
    import mpmath

    before = mpmath.mp.dps
    evaluate_precisely([PI], {}, digits=99)
    assert mpmath.mp.dps == before


def test_rational_functions_are_exact():
    e = (x**3 - y / 3) / (x - 2) ** 2
    assert is_rational(e)
    assert evaluate_exactly([e], {"x": Fraction(1, 3), "y": Fraction(2)}) == [
        (Fraction(1, 27) - Fraction(2, 3)) * Fraction(9, 25)
    ]


def test_roots_are_not_rational():
    assert not is_rational(x, sqrt(x))
    with pytest.raises(DomainError):
        evaluate_exactly([sqrt(x)], {"x": Fraction(4)})


@pytest.mark.parametrize(
    "e",
    [
        1 / x,
        call("log", x),
        call("log", x - 1),
        sqrt(x - 1),
        call("acosh", x),
        power(x - 1, Fraction(1, 3)),
        call("exp", 1 / x),
    ],
)
def test_values_outside_the_real_domain_are_errors(e):
    with pytest.raises(DomainError):
        evaluate([e], {"x": 0})
    with pytest.raises(DomainError):
        evaluate_precisely([e], {"x": Fraction(0)})


def test_overflow_is_an_error():
    with pytest.raises(DomainError):
        evaluate([call("exp", x)], {"x": 1000})


def test_scale_shows_cancellation():
    big = 10**20 * x
    ((value, scale),) = evaluate_with_scale([call("sin", x) + big - big], {"x": Fraction(1)})
    assert float(value) == pytest.approx(math.sin(1))
    assert scale >= 1e20


def test_missing_symbol_is_a_key_error():
    with pytest.raises(KeyError):
        evaluate([x], {})
