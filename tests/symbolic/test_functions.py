"""The record of each function agrees with its values: derivatives, parity, inverse, domain, value at 0."""

from fractions import Fraction

import mpmath
import pytest

from phigen.symbolic.expression import ZERO, call, derivatives, familiar, number, symbol
from phigen.symbolic.functions import FUNCTIONS
from phigen.symbolic.numeric import DomainError, evaluate, evaluate_precisely

X, Y = symbol("x"), symbol("y")
DIGITS = 40


def names(fact):
    """Return the names of the functions whose record has a value in the field ``fact``."""
    return [f.name for f in FUNCTIONS.values() if getattr(f, fact) and f.arity < 3]  # more: test_kepler, test_euler


def points(name):
    """Return points (x, y) in the domain of a function."""
    if name == "acosh":
        return [(Fraction(5, 4), Fraction(1)), (Fraction(3), Fraction(1))]
    inside = [(Fraction(3, 8), Fraction(2, 3)), (Fraction(1, 7), Fraction(-5, 4))]
    return inside if name in ("log", "power", "inv", "inv0") else [*inside, (Fraction(-2, 9), Fraction(3))]


def of(name):
    """Return the expression f(x), or f(x, y) for a function of two arguments."""
    return call(name, *[X, Y][: FUNCTIONS[name].arity])


def at(e, x, y):
    (value,) = evaluate_precisely([e], {"x": x, "y": y}, DIGITS)
    return value


@pytest.mark.parametrize("name", names("slopes"))
def test_derivatives_are_those_of_the_value(name):
    e, small = of(name), Fraction(1, 10**12)
    for x, y in points(name):
        for symbol_name, dx, dy in (("x", small, 0), ("y", 0, small)):
            (slope,) = derivatives([e], symbol_name)
            with mpmath.workdps(DIGITS):
                difference = (at(e, x + dx, y + dy) - at(e, x - dx, y - dy)) / (2 * mpmath.mpf(10) ** -12)
                assert abs(at(slope, x, y) - difference) < 1e-20


@pytest.mark.parametrize("name", names("known"))
def test_familiar_forms_have_the_same_value(name):
    (known,) = familiar([of(name)])
    assert not FUNCTIONS[known.op].own if known.op in FUNCTIONS else known.op
    for x, y in points(name):
        if x > 0:
            assert at(known, x, y) == pytest.approx(at(of(name), x, y), rel=1e-35)


@pytest.mark.parametrize("name", names("parity"))
def test_even_and_odd_functions_are_so(name):
    sign = {"even": 1, "odd": -1}[FUNCTIONS[name].parity]
    for x, y in points(name):
        assert at(of(name), -x, y) == sign * at(of(name), x, y)


@pytest.mark.parametrize("name", names("inverse"))
def test_inverses_undo_functions(name):
    for x, y in points(name):
        assert at(call(FUNCTIONS[name].inverse, of(name)), x, y) == pytest.approx(
            mpmath.mpf(x.numerator) / x.denominator, rel=1e-35
        )


@pytest.mark.parametrize("name", [f.name for f in FUNCTIONS.values() if f.arity == 1])
def test_values_at_zero_are_folded_where_they_are_rational(name):
    known = FUNCTIONS[name].at_zero
    if known is None:  # the value is irrational or undefined
        assert not call(name, ZERO).is_number
    else:
        assert call(name, ZERO) is number(known)
        assert evaluate([of(name)], {"x": 0.0}) == [float(known)]


@pytest.mark.parametrize("name", [f.name for f in FUNCTIONS.values() if not f.own])
def test_the_domain_is_where_there_is_a_value(name):
    known = FUNCTIONS[name]
    for value in (Fraction(v, 4) for v in (-9, -4, -2, 0, 3, 4, 9)):
        arguments = [value, Fraction(0)][: known.arity]
        try:
            evaluate_precisely([of(name)], {"x": arguments[0], "y": Fraction(0)})
        except DomainError:
            assert not known.defined(*arguments)
        else:
            assert known.defined(*arguments) or name == "atan2"
