"""Maps τ from a Lie algebra to its group that the spec gives."""

import pytest
from geometry.building import family, system
from systems import slow_but

from phigen.errors import SpecError
from phigen.geometry.system import system_from_spec
from phigen.realisations.axioms import check
from phigen.realisations.catalogue import realise
from phigen.spec import loads
from phigen.spec.model import BirealisationChoice
from phigen.symbolic.expression import call, symbol
from phigen.symbolic.symbols import MATRIX
from phigen.symbolic.verdict import PROVED, decide_zero

P = symbol(MATRIX)
CAYLEY = (1 + P / 2) / (1 - P / 2)


GROUPS = [("so", 3), ("sl", 2), ("se", 2), ("heisenberg", 1)]


def mapped(tau):
    return BirealisationChoice("group-map", tau=tau)


def of_text(algebra, tau, coordinates="x, y, z"):
    spec = loads(
        f"phigen: 1\nname: t\ncoordinates: [{coordinates}]\npoisson: {{lie_algebra: {algebra}}}\nhamiltonian: x\n"
        f"parameters: {{a: 2}}\nbirealisation: {{kind: group-map, tau: {tau}}}\n"
    )
    s = system_from_spec(spec)
    return s, realise(s, spec.birealisation)


@pytest.mark.thin(2)
@pytest.mark.parametrize(("name", "size"), [("so", 3), ("sl", 2), ("se", 2), ("se", 3), ("aff", 1), ("heisenberg", 1)])
def test_the_cayley_transform_is_the_kind_cayley(name, size):
    s = family(name, size, -1)
    realisation, expected = realise(s, mapped(CAYLEY)), realise(s, BirealisationChoice("cayley"))
    pairs = zip((*realisation.alpha, *realisation.beta), (*expected.alpha, *expected.beta), strict=True)
    assert decide_zero("τ = Cayley", [("", a - b) for a, b in pairs]).verdict == PROVED


@pytest.mark.parametrize(("name", "size"), slow_but([("sl", 2), ("heisenberg", 1)], GROUPS))
@pytest.mark.parametrize(
    "tau",
    [(1 + P / 2 + P**2 / 12) / (1 - P / 2 + P**2 / 12), ((1 + P / 4) / (1 - P / 4)) ** 2],
    ids=["Padé", "two half steps"],
)
def test_other_symmetric_maps_are_proved(name, size, tau):
    s = family(name, size)
    realisation = realise(s, mapped(tau))
    assert realisation.symmetric
    assert [statement.verdict for statement in check(s, realisation)] == [PROVED] * 5


@pytest.mark.parametrize("tau", [1 + P, 1 / (1 - P)])
def test_one_sided_maps_are_proved_and_not_symmetric(tau):
    s = family("heisenberg", 1)
    realisation = realise(s, mapped(tau))
    assert not realisation.symmetric
    assert "S_1 … S_k" in realisation.explanation
    assert [statement.verdict for statement in check(s, realisation)] == [PROVED] * 5


def test_entries_may_be_given_one_by_one():
    # Canonical coordinates of the second kind on the affine group: τ = exp(p_y b) exp(p_x a) with the generators a and
    # b.
    s, realisation = of_text("{name: aff(1)}", "[[exp(p_x), p_y], [0, 1]]", "x, y")
    assert [statement.verdict for statement in check(s, realisation)] == [PROVED] * 5
    assert not realisation.symmetric


def test_given_matrices_are_used_with_parameters():
    algebra = "{matrices: [[[0,a,0],[0,0,0],[0,0,0]], [[0,0,0],[0,0,1],[0,0,0]], [[0,0,1],[0,0,0],[0,0,0]]]}"
    s, realisation = of_text(algebra, "1 + P + P**2/2")
    assert realisation.symmetric
    assert [statement.verdict for statement in check(s, realisation)] == [PROVED] * 5


@pytest.mark.parametrize(
    ("tau", "message"),
    [
        ((1 + P) / (1 - P), r"the derivative of tau along p_x1 at 0 is not .*: entry \(2, 3\) is -2, not -1"),
        (2 + P, r"tau\(0\) is not the identity: entry \(1, 1\) is 2, not 1"),
        (1 / P, "singular for all p|no value at p = 0"),
        (1 + P, "tau does not stay in the group: its derivative leaves the algebra"),
        (call("sin", P), "tau uses sin of a matrix; it must be a rational function of P"),
        ([[P * 0 + 1]], "tau is not 3×3 like the 3×3 matrices of so"),
        (None, "needs tau"),
    ],
)  # fmt: skip
def test_what_is_no_group_map_is_refused(tau, message):
    with pytest.raises(SpecError, match=message):
        realise(family("so", 3), mapped(tau))


def test_a_nonlinear_tensor_is_refused():
    with pytest.raises(SpecError, match="needs a linear π"):
        realise(system("x y", "{brackets: {x: {y: x*y}}}"), mapped(CAYLEY))


def test_an_algebra_without_known_matrices_is_refused():
    with pytest.raises(SpecError, match="no faithful matrices"):
        realise(system("a b c d", "{brackets: {a: {b: c, c: d}}}"), mapped(1 + P))
