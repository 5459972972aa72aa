"""Recognition of the shape of π, for instance canonical or linear, in any notation and with parameters."""

import pytest
from geometry.building import family, system, typed

from phigen.geometry.lie_algebra import LieAlgebra
from phigen.geometry.shapes import Affine, Canonical, Constant, General, LiePoisson, LogCanonical

PARAMETERS = "parameters: {m: 2, l: {value: 3, positive: true}}"


def shape(coordinates, poisson):
    return system(coordinates, poisson, extra=PARAMETERS).shape


def test_canonical_pairs_are_found_in_any_order_and_sign():
    detected = shape("p q z y b", "{brackets: {q: {p: 1}, y: {b: '2/2'}}}")
    assert isinstance(detected, Canonical)
    assert (detected.q, detected.p, detected.rest) == (("q", "y"), ("p", "b"), ("z",))


@pytest.mark.parametrize(
    ("entry", "value"),
    [
        ("1 + sin(x)**2 + cos(x)**2", "2"),
        ("m*exp(x + y)*exp(-x - y)", "m"),
        ("(l*x + l)/(1 + x)", "l"),  # undefined at x = −1 only
        ("log(x)/log(x) + l*(cosh(y)**2 - sinh(y)**2)", "1 + l"),  # undefined at x = 1 and for x ≤ 0
        ("sqrt(x)**2/x + atan(y) - atan(y)", "1"),
    ],
)
def test_a_bracket_that_is_constant_by_an_identity_has_its_value(entry, value):
    detected = shape("x y", f"{{brackets: {{x: {{y: '{entry}'}}}}}}")
    assert isinstance(detected, Canonical if value == "1" else Constant)
    assert str(detected.matrix[0][1]) == value


@pytest.mark.parametrize(
    ("brackets", "kind"),
    [
        ("{x: {y: 'z*(sin(x)**2 + cos(x)**2)'}, y: {z: '(x**2 - x)/(x - 1)'}}", LiePoisson),
        ("{x: {y: 'z*(sin(x)**2 + cos(x)**2) + (x**2 - y**2)/(x - y) - x - y + l'}}", Affine),
        ("{x: {y: 'm*x*y*(cosh(z)**2 - sinh(z)**2)', z: 'x*z*exp(y)/exp(y)'}}", LogCanonical),
    ],
)
def test_linear_affine_and_log_canonical_brackets_are_found_by_identities(brackets, kind):
    detected = shape("x y z", f"{{brackets: {brackets}}}")
    assert isinstance(detected, kind)
    if kind is LogCanonical:
        assert [str(e) for e in detected.a[0]] == ["0", "m", "1"]


@pytest.mark.parametrize("entry", ["abs(x)/x", "sqrt(x**2)/x", "abs(x)*y/x", "sqrt(x**4 + 1) - x**2"])
def test_what_is_constant_in_parts_only_is_not_constant(entry):
    assert isinstance(shape("x y", f"{{brackets: {{x: {{y: '{entry}'}}}}}}"), General)


@pytest.mark.parametrize("value", ["2", "1/m", "m-1"])
def test_scaled_pairs_are_constant_but_not_canonical(value):
    assert isinstance(shape("q p", f"{{brackets: {{q: {{p: {value}}}}}}}"), Constant)


def test_chained_unit_brackets_are_constant_but_not_canonical():
    assert isinstance(shape("x y z", "{brackets: {x: {y: 1}, y: {z: 1}}}"), Constant)


def test_coordinates_that_cancel_do_not_count():
    assert isinstance(shape("q p", "{brackets: {q: {p: '(q+p)**2 - q**2 - 2*q*p - p**2 + 1'}}}"), Canonical)


def test_log_canonical_with_parameters():
    detected = shape("x y z", "{brackets: {x: {y: 'sqrt(l)*x*y'}, y: {z: -y*z/m}}}")
    assert isinstance(detected, LogCanonical)
    assert [str(e) for e in detected.a[1]] == ["-sqrt(l)", "0", "-1/m"]


@pytest.mark.parametrize("entry", ["x*y + 1", "x*y**2", "x*x", "x*y*exp(x)", "x"])
def test_almost_log_canonical_is_not(entry):
    assert not isinstance(shape("x y z", f"{{brackets: {{x: {{y: '{entry}'}}}}}}"), LogCanonical)


def test_rigid_body_with_inertia_in_the_bracket_is_a_lie_algebra():
    detected = shape("x y z", "{brackets: {x: {y: -z/m, z: y/l}, y: {z: -x}}}")
    assert isinstance(detected, LiePoisson)
    assert isinstance(detected.algebra, LieAlgebra)
    written = {ij: {k: str(c) for k, c in row.items()} for ij, row in detected.algebra.constants.items()}
    assert written == {(0, 1): {2: "-1/m"}, (0, 2): {1: "1/l"}, (1, 2): {0: "-1"}}


def test_structure_constants_survive_typing_as_a_matrix():
    original = family("sp", 4)
    assert typed(original).lie_algebra.constants == original.lie_algebra.constants


@pytest.mark.parametrize("entry", ["x**2 + 1", "x**2", "sin(x)", "x/y", "sqrt(x)", "x*z", "abs(x)"])
def test_the_rest_is_general(entry):
    assert isinstance(shape("x y z", f"{{brackets: {{x: {{y: '{entry}'}}}}}}"), General)


def test_abelian_lie_algebra_is_constant():
    assert isinstance(family("so", 2).shape, Constant)
