"""Lie algebras given by matrices or structure constants, and what is refused."""

import pytest
from geometry.building import system

from phigen.errors import SpecError
from phigen.geometry.checks import check
from phigen.geometry.matrix_algebras import from_structure_constants
from phigen.symbolic.expression import ONE, number, symbol
from phigen.symbolic.verdict import PROVED

PARAMETERS = "parameters: {m: 2, l: {value: 3, positive: true}}"


def test_matrices_with_parameters_span_an_algebra():
    s = system(
        "x y z",
        "{lie_algebra: {matrices: [[[0,m,0],[0,0,0],[0,0,0]], [[0,0,0],[0,0,1],[0,0,0]], [[0,0,l],[0,0,0],[0,0,0]]]}}",
        extra=PARAMETERS,
    )
    assert str(s.poisson[0][1]) == "z*(m/l)"
    assert {c.verdict for c in check(s) if c.name != "rank of π"} == {PROVED}


def test_commutator_outside_the_span_names_the_pair():
    with pytest.raises(SpecError, match=r"\[E1, E2\] is not in the span"):
        system("x y", "{lie_algebra: {matrices: [[[0,1],[0,0]], [[0,0],[1,0]]]}}")


def test_dependent_matrices_are_named():
    with pytest.raises(SpecError, match="E3 is a linear combination"):
        system("x y z", "{lie_algebra: {matrices: [[[0,1],[0,0]], [[1,0],[0,-1]], [[2,1],[0,-2]]]}}")


def test_structure_constants_may_be_given_in_either_order():
    one = system("x y z", "{lie_algebra: {structure_constants: {E1: {E2: {E3: 1}}}}}")
    two = system("x y z", "{lie_algebra: {structure_constants: {E2: {E1: {E3: -1}}}}}")
    assert one.poisson == two.poisson
    assert str(one.poisson[0][1]) == "z"


def test_contradicting_structure_constants_name_the_pair():
    with pytest.raises(SpecError, match=r"\[E1, E2\] = −\[E2, E1\] does not hold, component E3"):
        from_structure_constants(3, {0: {1: {2: ONE}}, 1: {0: {2: ONE}}})
    with pytest.raises(SpecError, match=r"\[E2, E2\] = 0 does not hold"):
        from_structure_constants(3, {1: {1: {2: ONE}}})


def test_failing_jacobi_identity_names_the_triple_and_the_component():
    # With [E1, E2] = E3 and [E1, E3] = E1, the double brackets of (E1, E2, E3) add up to a multiple of E3 instead of 0.
    with pytest.raises(SpecError, match=r"Jacobi identity fails for \(E1, E2, E3\).*E3"):
        from_structure_constants(3, {0: {1: {2: ONE}, 2: {0: ONE}}})


def test_jacobi_may_hold_by_a_relation_of_the_parameters():
    a, b = symbol("a"), symbol("b")
    zero = (a + b) ** 2 - a**2 - b**2 - 2 * a * b
    from_structure_constants(3, {0: {1: {2: ONE}, 2: {0: zero}}})


def test_index_out_of_range_is_an_error():
    with pytest.raises(SpecError, match="E4"):
        from_structure_constants(3, {0: {1: {3: number(2)}}})
