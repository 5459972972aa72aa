"""The functions cos √s, sin(√s)/√s, (e^s − 1)/s and their derivatives: values, derivatives, and relations that the
differential ring knows.
"""

import math
from fractions import Fraction

import mpmath
import pytest
from support import values

from phigen.errors import SpecError
from phigen.spec import loads
from phigen.symbolic.entire import ENTIRE, by_closed_form, in_double
from phigen.symbolic.expression import ZERO, call, derivative, number, symbol
from phigen.symbolic.numeric import evaluate, evaluate_precisely
from phigen.symbolic.verdict import PROVED, REFUTED, decide_zero

s, t = symbol("s"), symbol("t")


@pytest.mark.parametrize("name", ENTIRE)
@pytest.mark.parametrize("at", [1e-9, -1e-9, 0.3, -0.3, 0.5001, 0.999, 1.001, -1.001, 3.0, -3.0])
def test_values_have_full_precision(name, at):
    with mpmath.workdps(40):
        (expected,) = values([call(name, s)], {"s": mpmath.mpf(at)})
        bound = 1e-14 if name.endswith("1") else 1e-15
        assert in_double(name, at) == pytest.approx(float(expected), rel=bound)
        assert evaluate([call(name, s)], {"s": at}) == [in_double(name, at)]
        (precise,) = evaluate_precisely([call(name, s)], {"s": Fraction(at)}, 30)
        assert abs(mpmath.mpf(str(precise)) / expected - 1) < 1e-18


@pytest.mark.parametrize("name", ENTIRE)
def test_at_zero(name):
    assert call(name, ZERO) is number(ENTIRE[name].coefficient(0))
    assert evaluate([call(name, s)], {"s": 0.0}) == [float(ENTIRE[name].coefficient(0))]


def test_tangent_maps_need_no_second_derivatives():
    with pytest.raises(ValueError, match="no derivative is known for sinroot1"):
        derivative(call("sinroot1", s), "s")


def test_the_ring_knows_their_relations():
    c, r, e = (call(n, s * t**2) for n in ("cosroot", "sinroot", "exprel"))
    half, drift = call("sinroot", s * t**2 / 4), t**3 * call("arcroot", s * t**2)
    held = {
        "circle": c**2 + s * t**2 * r**2 - 1,
        "rotation": derivative(t * r, "t") - c,
        "and back": derivative(c, "t") + s * t * r,
        "drift": derivative(drift, "t") - t**2 * half**2 / 2,
        "growth": s * t**2 * e - (call("exp", s * t**2) - 1),
        "its slope": derivative(e * t, "t") - 2 * call("exp", s * t**2) + e,
    }
    for name, residual in held.items():
        assert decide_zero(name, [("", residual)]).verdict == PROVED, name
    assert decide_zero("not so", [("", c**2 - s * t**2 * r**2 - 1)]).verdict == REFUTED
    assert decide_zero("alone", [("", c**2 - 1)]).verdict == REFUTED


def test_series_are_long_enough_and_no_longer():
    for name, function in ENTIRE.items():
        terms = function.terms()
        last = abs(float(terms[-1])) * function.radius ** (len(terms) - 1)
        assert last > 1e-18 * abs(float(terms[0])), name
        assert math.isclose(
            in_double(name, function.radius),
            float(by_closed_form(mpmath.mp, name, mpmath.mpf(function.radius))),
            rel_tol=1e-15,
        )


@pytest.mark.parametrize("name", ENTIRE)
def test_specs_do_not_have_them(name):
    with pytest.raises(SpecError, match=f"'{name}'"):
        loads(
            "phigen: 1\nname: t\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
            f"hamiltonian: {name}(q)\n"
        )
