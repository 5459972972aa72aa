"""Statements on systems, such as the Jacobi identity: proved for the corpus, and refuted for wrong systems."""

import pytest
from geometry.building import family, system

from phigen.geometry.checks import check, rank_statement, skew_symmetry
from phigen.geometry.jacobi import jacobi_identity
from phigen.geometry.system import build_system, system_from_spec
from phigen.resources import bundled_specs
from phigen.spec import load
from phigen.spec.model import MatrixForm
from phigen.symbolic.expression import ONE, ZERO, symbol
from phigen.symbolic.verdict import CHECKED, PROVED, REFUTED

CORPUS = sorted(bundled_specs().glob("*.yaml"))
KEPLER = """
parameters: {mu: {value: 1, positive: true}}
invariants:
  L: x*v - y*u
  A: v*(x*v - y*u) - mu*x/sqrt(x**2+y**2)
"""


@pytest.mark.parametrize("path", CORPUS, ids=lambda p: p.stem)
def test_everything_declared_in_the_corpus_is_proved(path):
    statements = check(system_from_spec(load(path)))
    assert {s.verdict for s in statements if s.name != "rank of π"} == {PROVED}


@pytest.mark.parametrize("path", CORPUS, ids=lambda p: p.stem)
def test_all_casimirs_of_the_corpus_are_known(path):
    system = system_from_spec(load(path))
    rank = rank_statement(system)
    assert rank.verdict == CHECKED
    known, all_of_them = rank.detail.split(", ")[1].split(" independent")[0].split(" of ")
    assert known == all_of_them


def charged_particle(b3, b1="0", b2="0"):
    return system(
        "x y z u v w",
        f"{{brackets: {{x: {{u: 1}}, y: {{v: 1}}, z: {{w: 1}}, u: {{v: '{b3}', w: '-({b2})'}}, v: {{w: '{b1}'}}}}}}",
        "(u**2+v**2+w**2)/2",
    )


def test_magnetic_field_without_divergence_is_poisson():
    assert jacobi_identity(charged_particle("1+x**2+y**2")).verdict == PROVED
    assert jacobi_identity(charged_particle("-2*z", "x", "y")).verdict == PROVED


def test_magnetic_field_with_divergence_fails_in_exactly_one_component():
    statement = jacobi_identity(charged_particle("z", "x", "y"))
    assert statement.verdict == REFUTED
    assert "(u, v, w)" in statement.detail
    assert "parts do not reduce" not in statement.detail  # only one of the 20 components fails
    assert statement.residual == "3"


def test_jacobi_identity_holds_for_all_parameters_or_is_refuted():
    brackets = "{brackets: {x: {y: a*z, z: -b*y}, y: {z: c*x}}}"
    parameters = "parameters: {a: 1, b: 1, c: 1}"
    assert jacobi_identity(system("x y z", brackets, extra=parameters)).verdict == PROVED
    bent = "{brackets: {x: {y: a*z + b*x, z: -b*y}, y: {z: c*x}}}"
    assert jacobi_identity(system("x y z", bent, extra=parameters)).verdict == REFUTED


def test_non_polynomial_poisson_tensors_are_proved_or_refuted():
    # On R³, a tensor of rank 2 that has a Casimir stays Poisson if it is multiplied by any function.
    conformal = "exp(x)*sqrt(1+y**2)/z"
    good = f"{{brackets: {{x: {{y: 'z*{conformal}', z: '-y*{conformal}'}}, y: {{z: 'x*{conformal}'}}}}}}"
    assert jacobi_identity(system("x y z", good)).verdict == PROVED
    bad = f"{{brackets: {{x: {{y: 'z*{conformal}', z: '-y'}}, y: {{z: 'x*{conformal}'}}}}}}"
    assert jacobi_identity(system("x y z", bad)).verdict == REFUTED


def test_matrix_that_is_not_skew_is_refuted_naming_the_pair():
    x = symbol("x")
    s = build_system("t", ["x", "y"], [], MatrixForm(((ZERO, x), (ONE - x, ZERO))), x)
    statement = skew_symmetry(s)
    assert statement.verdict == REFUTED
    assert statement.detail.startswith("(x, y)")
    diagonal = build_system("t", ["x", "y"], [], MatrixForm(((x, ZERO), (ZERO, ZERO))), x)
    assert skew_symmetry(diagonal).verdict == REFUTED


def test_wrong_casimir_and_wrong_invariant_are_refuted():
    s = system(
        "x y z",
        "{lie_algebra: {name: so(3)}}",
        "x**2 + 2*y**2 + 3*z**2",
        "casimirs: {C: x**2 + y**2 - z**2}\ninvariants: {K: x, C2: x**2 + y**2 + z**2}",
    )
    verdicts = {c.name: c for c in check(s)}
    assert verdicts["C is a Casimir"].verdict == REFUTED
    assert "{x, C}" in verdicts["C is a Casimir"].detail
    assert verdicts["K is invariant"].verdict == REFUTED
    assert verdicts["C2 is invariant"].verdict == PROVED


def test_kepler_invariants_are_proved_through_the_square_root():
    s = system("x y u v", "{canonical: {q: [x, y], p: [u, v]}}", "(u**2+v**2)/2 - mu/sqrt(x**2+y**2)", KEPLER)
    assert [c.verdict for c in check(s) if "invariant" in c.name] == [PROVED, PROVED]


def test_invariant_beyond_the_ring_is_reported_as_checked_at_points():
    s = system("q p", "{canonical: {q: [q], p: [p]}}", "p - sin(2*q)", "invariants: {F: p - 2*sin(q)*cos(q)}")
    (statement,) = [c for c in check(s) if c.name == "F is invariant"]
    assert statement.verdict == CHECKED
    assert "8 points" in statement.detail


def test_rank_counts_missing_casimirs():
    s = system("x y z", "{nambu: ['tanh(x*y) + z']}")
    assert "1 of 1" in rank_statement(s).detail
    matrix = [[str(e) for e in row] for row in s.poisson]
    forgotten = system("x y z", f"{{matrix: {matrix}}}")
    assert "0 of 1" in rank_statement(forgotten).detail
    assert "not polynomial" in rank_statement(forgotten).detail


def test_rank_is_generic_not_that_of_a_special_point():
    assert rank_statement(family("so", 4)).detail.startswith("4 at 3 generic points, 2 of 2")
    assert rank_statement(system("x y", "{brackets: {x: {y: 'sin(x) - sin(x)'}}}")).detail.startswith("0 at")
