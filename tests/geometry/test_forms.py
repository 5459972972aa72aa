"""Each form of the key ``poisson`` gives the brackets that it stands for."""

import pytest
from geometry.building import family, system, texts

from phigen.errors import SpecError
from phigen.geometry.checks import check
from phigen.geometry.system import build_system
from phigen.spec.model import LieAlgebraForm
from phigen.symbolic.expression import ZERO, symbol
from phigen.symbolic.verdict import PROVED, decide_zero


def brackets(s):
    n = s.dimension
    return {
        (s.coordinates[i], s.coordinates[j]): str(s.poisson[i][j])
        for i in range(n)
        for j in range(n)
        if not s.poisson[i][j].is_zero
    }


def test_canonical_bracket_of_position_and_momentum_is_one():
    s = system("p1 q1 z", "{canonical: {q: [q1], p: [p1]}}", "q1*z + p1**2")
    assert brackets(s) == {("q1", "p1"): "1", ("p1", "q1"): "-1"}
    assert texts(s.vector_field()) == ["-z", "2*p1", "0"]
    assert texts(s.casimirs.values()) == ["z"]


def test_log_canonical_gives_the_lotka_volterra_field():
    s = system("x1 x2 x3", "{log_canonical: [[0,1,1],[-1,0,1],[-1,-1,0]]}", "x1+x2+x3")
    expected = ["x1*(x2+x3)", "x2*(x3-x1)", "-x3*(x1+x2)"]
    subject = system("x1 x2 x3", "{canonical: {q: [x1], p: [x2]}}", "0", f"invariants: {dict(enumerate_as(expected))}")
    residuals = [("", f - g) for f, g in zip(s.vector_field(), subject.invariants.values(), strict=True)]
    assert decide_zero("field", residuals).verdict == PROVED


def enumerate_as(formulas):
    return ((f"F{i}", f) for i, f in enumerate(formulas))


def test_nambu_bracket_on_three_coordinates_is_grad_h_cross_grad_c():
    s = system("x y z", "{nambu: ['(x**2+y**2+z**2)/2']}", "x*2+y*3+z*5")
    # The expected field is ∇H × ∇C with ∇H = (2, 3, 5) and ∇C = (x, y, z).
    x, y, z = map(symbol, s.coordinates)
    residuals = zip(s.vector_field(), (3 * z - 5 * y, 5 * x - 2 * z, 2 * y - 3 * x), strict=True)
    assert decide_zero("field", [("", f - g) for f, g in residuals]).verdict == PROVED
    assert brackets(s)["x", "y"] == "z"


def test_nambu_bracket_on_four_coordinates_is_the_jacobian_determinant():
    s = system("a b c d", "{nambu: [c, d]}")
    assert brackets(s) == {("a", "b"): "1", ("b", "a"): "-1"}  # det ∂(a, b, c, d)/∂(a, b, c, d) = 1
    s = system("a b c d", "{nambu: [b, c]}")
    # det ∂(a, d, b, c)/∂(a, b, c, d) = 1, since the permutation is even.
    assert brackets(s) == {("a", "d"): "1", ("d", "a"): "-1"}
    s = system("a b c d", "{nambu: [a*b, c*d]}")
    assert all(c.holds for c in check(s))
    assert texts(s.casimirs.values()) == ["a*b", "c*d"]


def test_nambu_casimirs_may_be_any_functions():
    s = system("x y z", "{nambu: ['exp(x)*y + sqrt(1+z**2)']}", "x*y*z")
    assert all(c.holds for c in check(s))
    assert {c.verdict for c in check(s) if "rank" not in c.name} == {PROVED}


def test_nambu_needs_two_casimirs_less_than_coordinates():
    with pytest.raises(SpecError, match=r"4 coordinates need 2 Casimirs|2 Casimirs"):
        system("a b c d", "{nambu: [a]}")


def test_sign_negates_all_brackets_of_a_lie_algebra():
    plus, minus = family("se", 3, 1), family("se", 3, -1)
    assert brackets(plus)["x1", "x2"] == "x3"
    assert brackets(minus)["x1", "x2"] == "-x3"
    for row, other in zip(plus.poisson, minus.poisson, strict=True):
        assert [(-e) for e in row] == list(other)


def test_wrong_dimension_of_a_named_algebra_is_an_error_before_it_is_built():
    with pytest.raises(SpecError, match="dimension 499500"):
        build_system("t", ["x"], [], LieAlgebraForm(family="so", size=1000), ZERO)


def test_errors_carry_the_place_in_the_spec():
    with pytest.raises(SpecError) as caught:
        system("x y z", "{lie_algebra: {name: so(4)}}")
    assert caught.value.diagnostics[0].location.line == 4


def test_dimension_two_and_zero_brackets_are_fine():
    assert all(c.holds for c in check(system("x y", "{matrix: [[0, 0], [0, 0]]}")))
    assert texts(system("x y", "{matrix: [[0, 0], [0, 0]]}").casimirs.values()) == ["x", "y"]
