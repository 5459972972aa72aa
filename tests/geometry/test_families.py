"""Named Lie algebras: bases, their order and signs, and representations."""

import pytest
from geometry.building import family

from phigen.errors import SpecError
from phigen.geometry.checks import check
from phigen.geometry.families import dimension, families_of_dimension, named
from phigen.geometry.linear import add_multiple
from phigen.geometry.matrix_algebras import jacobi_residuals, product
from phigen.geometry.system import system_from_spec
from phigen.resources import bundled_specs
from phigen.spec import load
from phigen.symbolic.verdict import PROVED

FAMILIES = [
    ("so", 2), ("so", 3), ("so", 4), ("so", 5), ("so", 6), ("se", 2), ("se", 3), ("se", 4), ("sl", 2), ("sl", 3),
    ("gl", 1), ("gl", 2), ("gl", 3), ("su", 2), ("su", 3), ("sp", 2), ("sp", 4), ("heisenberg", 1), ("heisenberg", 2),
    ("aff", 1), ("aff", 2),
]  # fmt: skip
DIMENSIONS = {
    ("so", 5): 10, ("se", 3): 6, ("sl", 3): 8, ("gl", 3): 9, ("su", 3): 8, ("sp", 4): 10, ("heisenberg", 2): 5,
    ("aff", 1): 2,
}  # fmt: skip


def constants(name, size):
    """Return the structure constants of a named algebra, [E_i, E_j] = Σ c E_k, as {(i, j): {k: c}} with indices from 1
    and numbers as texts.
    """
    rows = named(name, size).constants.items()
    return {(i + 1, j + 1): {k + 1: str(c) for k, c in row.items()} for (i, j), row in rows}


@pytest.mark.parametrize(("name", "size"), FAMILIES)
def test_dimension_formula_counts_the_basis(name, size):
    assert named(name, size).dimension == dimension(name, size)
    assert DIMENSIONS.get((name, size), dimension(name, size)) == dimension(name, size)
    assert (name, size) in families_of_dimension(dimension(name, size))


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("name", "size"), FAMILIES)
def test_matrices_represent_the_bracket(name, size, sign):
    algebra = named(name, size) if sign > 0 else named(name, size).opposite()
    field = algebra.field
    matrices = [{at: field.convert(v) for at, v in m.items()} for m in algebra.representation.matrices]
    for i in range(algebra.dimension):
        for j in range(algebra.dimension):
            difference = product(matrices[i], matrices[j])
            add_multiple(difference, product(matrices[j], matrices[i]), -field.one)
            for k, c in algebra.bracket(i, j).items():
                add_multiple(difference, matrices[k], -field.convert(c))
            assert difference == {}


@pytest.mark.parametrize(("name", "size"), FAMILIES)
def test_the_dual_is_a_poisson_manifold_and_found_casimirs_are_proved(name, size):
    statements = check(family(name, size))
    assert all(s.holds for s in statements)
    assert {s.verdict for s in statements if s.name != "rank of π"} == {PROVED}


def test_rotations_have_the_cyclic_bracket():
    assert constants("so", 3) == {(1, 2): {3: "1"}, (1, 3): {2: "-1"}, (2, 3): {1: "1"}}
    assert constants("su", 2) == constants("so", 3)


def test_sl2_is_h_e_f():
    assert constants("sl", 2) == {(1, 2): {2: "2"}, (1, 3): {3: "-2"}, (2, 3): {1: "1"}}


def test_small_families_have_the_documented_bases():
    assert constants("aff", 1) == {(1, 2): {2: "1"}}
    assert constants("heisenberg", 2) == {(1, 3): {5: "1"}, (2, 4): {5: "1"}}
    assert constants("se", 2) == {(1, 2): {3: "1"}, (1, 3): {2: "-1"}}
    assert constants("gl", 2)[2, 3] == {1: "1", 4: "-1"}
    # [E12, E13] = −E23, where E12, E13, E14, E23 are the first elements of the basis.
    assert constants("so", 4)[1, 2] == {4: "-1"}


@pytest.mark.parametrize(
    ("spec", "name", "size", "sign"),
    [("rigid_body", "so", 3, -1), ("lagrange_top", "se", 3, -1), ("so4_manakov", "so", 4, 1)],
)
def test_corpus_brackets_are_those_of_the_families(spec, name, size, sign):
    system = system_from_spec(load(bundled_specs() / f"{spec}.yaml"))
    algebra = named(name, size) if sign > 0 else named(name, size).opposite()
    assert system.poisson == algebra.poisson(system.coordinates)


@pytest.mark.parametrize(("name", "size"), FAMILIES)
def test_jacobi_holds_in_the_structure_constants(name, size):
    algebra = named(name, size)
    n = algebra.dimension
    triples = ((i, j, k) for i in range(n) for j in range(i) for k in range(j))
    assert all(jacobi_residuals(algebra, *t) == {} for t in triples)


@pytest.mark.parametrize(("name", "size"), [("so", 1), ("sp", 3), ("sl", 1), ("e", 8), ("heisenberg", 0)])
def test_algebras_that_do_not_exist_are_errors(name, size):
    with pytest.raises(SpecError):
        named(name, size)
