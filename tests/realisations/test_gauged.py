"""Tensors π_ij = g_i(x_i) A_ij g_j(x_j): they are recognised in any notation, and their bi-realisation uses the flows
of ẋ_i = g_i(x_i).
"""

import pytest
from geometry.building import system

from phigen.errors import SpecError
from phigen.geometry.separated import separated
from phigen.realisations.axioms import check
from phigen.realisations.catalogue import realise
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.numeric import evaluate
from phigen.symbolic.symbols import momentum
from phigen.symbolic.verdict import CHECKED, PROVED

GAUGED, KARASEV = BirealisationChoice("gauged"), BirealisationChoice("karasev")
PARAMETERS = "parameters: {a: 1, b: 2, c: {value: 3, positive: true}}"


def tensor(coordinates, brackets):
    return system(coordinates, f"{{brackets: {brackets}}}", extra=PARAMETERS)


@pytest.mark.parametrize(
    ("coordinates", "brackets"),
    [
        ("x y", "{x: {y: (x+1)*(y-2)}}"),  # log-canonical, shifted
        ("x y", "{x: {y: x*y + x + y + 1}}"),  # the same kind, multiplied out
        ("x y", "{x: {y: 1 + x**2}}"),
        ("x y z", "{x: {y: b*(1+x**2)*(y**2-a), z: 1+x**2}, y: {z: 3*(y**2-a)}}"),
        ("x y z", "{x: {y: (a*x**2+b*x+c)*y, z: (a*x**2+b*x+c)*z}, y: {z: y*z}}"),
        ("x y", "{x: {y: (x**2 - c)*y**2}}"),  # a parameter of known sign
        ("x y", "{x: {y: (x-1)*(x-2)*(2*y**2 + 2*y + 5)}}"),  # a factor with two real roots, and one without
        ("x y", "{x: {y: x**3*y}}"),
        ("x y", "{x: {y: 1/x}}"),
    ],
)
def test_axioms_are_proved(coordinates, brackets):
    s = tensor(coordinates, brackets)
    realisation = realise(s)
    assert realisation.kind == "gauged"
    assert realisation.symmetric
    assert realisation.explanation.startswith("auto picked gauged, since π is constant in other coordinates")
    assert [statement.verdict for statement in check(s, realisation)] == [PROVED] * 5


@pytest.mark.parametrize("brackets", ["{x: {y: 2*exp(3*x)*y}}", "{x: {y: sqrt(x)*y**2}}"])
def test_other_factors_hold_at_least_numerically(brackets):
    s = tensor("x y", brackets)
    realisation = realise(s)
    assert realisation.kind == "gauged"
    assert {statement.verdict for statement in check(s, realisation)} <= {PROVED, CHECKED}


def test_a_log_canonical_tensor_gives_the_log_canonical_maps():
    s = tensor("x y z", "{x: {y: x*y, z: 2*x*z}, y: {z: y*z}}")
    assert realise(s).kind == "log-canonical"
    point = {"x": 0.5, "y": 1.25, "z": -2.0, momentum("x"): 0.25, momentum("y"): -0.125, momentum("z"): 0.3}
    pairs = [(r.alpha, r.beta, r.increment) for r in (realise(s, GAUGED), realise(s))]
    for one, other in zip(*pairs, strict=True):
        assert evaluate(one, point) == pytest.approx(evaluate(other, point), rel=1e-14)


@pytest.mark.parametrize("factor", ["(x**2 + 3*x + 1)", "(x**2 + a)", "(x**2 - c)", "(2*x + 1)", "exp(x)", "x**3"])
def test_the_displacement_is_the_flow_of_the_factor(factor):
    # β_x is the flow of ẋ = g(x) for the time ½u_x, where u_x = p_y for {x, y} = g(x). The expected value is computed
    # by RK4 with small steps.
    s = tensor("x y", f"{{x: {{y: '{factor}'}}}}")
    realisation = realise(s, GAUGED)
    start = {"x": 0.7, "y": 0.0, momentum("x"): 0.0, momentum("y"): 0.3, "a": 1.0, "b": 2.0, "c": 3.0}
    g = s.poisson[0][1]

    def slope(x):
        return evaluate([g], start | {"x": x})[0]

    x, h = 0.7, 0.15 / 400
    for _ in range(400):
        k1 = slope(x)
        k2 = slope(x + h / 2 * k1)
        k3 = slope(x + h / 2 * k2)
        x += h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(x + h * k3))
    assert evaluate([realisation.beta[0]], start)[0] == pytest.approx(x, rel=1e-12)


def test_small_momenta_lose_no_digits():
    s = tensor("x y", "{x: {y: x**2 + b*x + a}}")
    realisation = realise(s)
    for size in (1e-3, 1e-9, 1e-15):
        point = {"x": 0.7, "y": 1.0, momentum("x"): 0.0, momentum("y"): size, "a": 1.0, "b": 2.0}
        assert evaluate([realisation.increment[0]], point)[0] == pytest.approx(size * 2.89, rel=2 * size + 1e-15)


def test_factors_are_found_up_to_constants():
    s = tensor("x y z", "{x: {y: 2*a*(x+1)*y, z: b*(x+1)}, y: {z: -y}}")
    factors = separated(s.coordinates, s.poisson)
    assert [str(g) for g in factors.factors] == ["1 + x", "y", "1"]
    assert [str(e) for e in factors.matrix[0]] == ["0", "2*a", "b"]


def test_factors_that_are_constant_by_an_identity_are_constants():
    s = tensor("x y z", "{x: {y: exp(x)*(1 + sin(y)**2 + cos(y)**2), z: a*exp(x)*(cosh(x)**2 - sinh(x)**2)}}")
    factors = separated(s.coordinates, s.poisson)
    assert [str(g) for g in factors.factors] == ["exp(x)", "1", "1"]
    assert [str(e) for e in factors.matrix[0]] == ["0", "2", "a"]
    assert realise(s).kind == "gauged"


@pytest.mark.parametrize(
    "brackets",
    [
        "{x: {y: 1 + x*y}}",  # no product of functions of one coordinate
        "{x: {y: x*y, z: x**2*z}}",  # two different factors of x
        "{x: {y: z}}",  # depends on neither x nor y
    ],
)
def test_other_tensors_are_not_separated(brackets):
    s = tensor("x y z", brackets)
    assert separated(s.coordinates, s.poisson) is None
    with pytest.raises(SpecError, match="needs π_ij = g_i"):
        realise(s, GAUGED)


def test_a_factor_without_known_flow_is_refused_naming_it():
    with pytest.raises(SpecError, match=r"no formula for the flow of x' = sin\(x\)"):
        realise(tensor("x y", "{x: {y: sin(x)}}"), GAUGED)
    assert realise(tensor("x y", "{x: {y: sin(x)}}")).kind == "karasev"
