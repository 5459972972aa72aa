"""The function φ(s) = (1 − w cot w)/s with w = √s/2, and its derivatives: series, values, and derivatives in rings."""

import math
from fractions import Fraction

import mpmath
import pytest

from phigen.errors import SpecError
from phigen.spec import loads
from phigen.symbolic.expression import ZERO, call, derivative, number, symbol
from phigen.symbolic.numeric import evaluate, evaluate_precisely
from phigen.symbolic.special import MIDDLE, NEAR, POLE, SPECIAL, coefficient, in_double
from phigen.symbolic.taylor import ExpressionRing, Taylor
from phigen.symbolic.tower import Tower
from phigen.symbolic.verdict import PROVED, REFUTED, decide_zero

s = symbol("s")


def reference(order, at):
    """Return the derivative of φ of the given order, from the closed form in 60 digits."""
    with mpmath.workdps(60):

        def phi(z):
            w = mpmath.sqrt(z) / 2
            return (1 - w * mpmath.cot(w)) / z

        return mpmath.re(mpmath.diff(phi, mpmath.mpc(at), order))


def test_series_coefficients_are_bernoulli_numbers():
    for n in range(12):
        top, bottom = mpmath.bernfrac(2 * n + 2)
        assert coefficient(0, n) == abs(Fraction(int(top), int(bottom))) / math.factorial(2 * n + 2)
        assert coefficient(1, n) == (n + 1) * coefficient(0, n + 1)
        assert coefficient(2, n) == (n + 2) * (n + 1) * coefficient(0, n + 2)


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize(
    "at", [1e-12, -1e-12, 0.1, -0.2, NEAR - 1e-9, NEAR + 1e-9, 1.0, -7.0, 12.0, -15.0, MIDDLE + 1e-9, -20.0, 25.0, 35.0]
)
def test_values_have_full_precision(order, at):
    expected = reference(order, at)
    assert in_double(order, at) == pytest.approx(float(expected), rel=3e-15)
    (precise,) = evaluate_precisely([call(SPECIAL[order], number(Fraction(at)))], {}, 40)
    with mpmath.workdps(60):
        assert abs(mpmath.mpf(str(precise)) / expected - 1) < 1e-24


@pytest.mark.parametrize("order", [0, 1, 2])
def test_at_zero_and_at_the_pole(order):
    assert evaluate([call(SPECIAL[order], s)], {"s": 0.0}) == [float(coefficient(order, 0))]
    assert call(SPECIAL[order], ZERO) is number(coefficient(order, 0))
    assert abs(in_double(order, POLE)) > 1e12
    assert in_double(order, POLE - 1e-3) > 1e3
    assert in_double(0, POLE + 1e-3) < -1e3


def test_derivatives_end_with_the_second():
    x = symbol("x")
    assert derivative(call("phi0", x**2), "x") is 2 * x * call("phi1", x**2)
    assert derivative(call("phi1", x), "x") is call("phi2", x)
    with pytest.raises(ValueError, match="no derivative is known for phi2"):
        derivative(call("phi2", x), "x")


def test_the_ring_knows_the_riccati_equation():
    phi, slope, bend = (call(f, s) for f in SPECIAL)
    riccati = s * slope - (number(Fraction(1, 8)) - Fraction(3, 2) * phi + Fraction(1, 2) * s * phi**2)
    assert decide_zero("sφ' = 1/8 − (3/2)φ + ½sφ²", [("", riccati)]).verdict == PROVED
    assert decide_zero("its derivative", [("", derivative(riccati, "s"))]).verdict == PROVED
    assert decide_zero("φ' = 0", [("", slope)]).verdict == REFUTED
    assert decide_zero("φ'' = φ'", [("", bend - slope)]).verdict == REFUTED


@pytest.mark.parametrize("order", [0, 1])
def test_composition_with_series(order):
    # Expand φ^(order)(t²(x + t)) in powers of t.
    x, t = symbol("x"), symbol("t")
    target = call(SPECIAL[order], t**2 * (x + t))
    a = [coefficient(order, n) for n in range(4)]
    expected = [a[0], 0, a[1] * x, number(a[1]), a[2] * x**2, 2 * a[2] * x, a[2] + a[3] * x**3]
    for ring in (ExpressionRing(), Tower(["x"])):
        taylor = Taylor([target], ring, ["t"])
        for level in range(7):
            taylor.advance({"t": ring.constant(1 if level == 1 else 0)})
        for computed, expected_coefficient in zip(taylor.coefficients(target), expected, strict=True):
            value = computed if isinstance(ring, ExpressionRing) else ring.expression(computed)
            assert decide_zero("", [("", value - expected_coefficient)]).verdict == PROVED


def test_no_series_about_other_points():
    taylor = Taylor([call("phi0", symbol("t"))], ExpressionRing(), ["t"])
    with pytest.raises(ValueError, match="series about 0 only"):
        taylor.advance({"t": number(1)})


@pytest.mark.parametrize("name", SPECIAL)
def test_specs_do_not_have_them(name):
    with pytest.raises(SpecError, match=f"'{name}'"):
        loads(
            "phigen: 1\nname: t\ncoordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\n"
            f"hamiltonian: {name}(q)\n"
        )
