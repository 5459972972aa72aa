"""Star algebras: found for Lie algebras of small rank, their axioms decided in exact arithmetic."""

from dataclasses import replace

import pytest

from phigen.gauss.matrices import of_matrices
from phigen.gauss.quaternionic import quaternionic
from phigen.geometry.families import named
from phigen.geometry.matrix_algebras import from_structure_constants
from phigen.symbolic.expression import number, symbol

#: Dimensions of the algebras: quaternions over the reals, two copies of them, dual ones; nilpotent and solvable ones.
DIMENSIONS = {
    ("so", 3): 4, ("su", 2): 4, ("sl", 2): 4, ("so", 4): 8, ("se", 3): 8, ("se", 2): 4, ("heisenberg", 2): 6,
    ("aff", 1): 3, ("gl", 2): 6,
}  # fmt: skip


def constants(brackets):
    """Structure constants from {(i, j): {k: number}}."""
    found = {}
    for (i, j), row in brackets.items():
        found.setdefault(i, {})[j] = {k: number(v) for k, v in row.items()}
    return found


OSCILLATOR = from_structure_constants(4, constants({(0, 1): {2: 1}, (0, 2): {1: -1}, (1, 2): {3: 1}}))


@pytest.mark.parametrize(("family", "size"), DIMENSIONS)
def test_named_algebras_have_star_algebras(family, size):
    lie = named(family, size)
    found = quaternionic(lie)
    assert found is not None
    assert found.dimension == DIMENSIONS[family, size]
    assert found.sound
    for i in range(lie.dimension):
        for j in range(lie.dimension):
            expected = {}
            for k, c in lie.bracket(i, j).items():
                for at, v in found.basis[k].items():
                    expected[at] = expected.get(at, found.field.zero) + v * found.field.convert(c)
            expected = {at: v for at, v in expected.items() if v != 0}
            assert found.commutator(found.basis[i], found.basis[j]) == expected


def test_oscillator_algebra_has_one():
    found = quaternionic(OSCILLATOR)
    assert found is not None
    assert (found.dimension, found.sound) == (6, True)


def test_change_of_basis_with_parameters():
    """[a, b] = r·c, [b, c] = s·a, [c, a] = b/r, which is so(3) or sl(2) by the sign of s."""
    r, s = symbol("r"), symbol("s")
    lie = from_structure_constants(3, {0: {1: {2: r}, 2: {1: -1 / r}}, 1: {2: {0: s}}})
    found = quaternionic(lie)
    assert found is not None
    assert (found.dimension, found.sound) == (4, True)


def test_algebras_of_matrices_have_one_of_matrices():
    """so(5) keeps a form on R^5; sl(3) keeps none, and acts on R^3 and its dual; motions of R^4 do neither."""
    found = {name: of_matrices(named(*name)) for name in (("so", 5), ("sl", 3), ("se", 4))}
    assert found["se", 4] is None
    assert {name: a and (a.dimension, a.sound) for name, a in found.items() if name != ("se", 4)} == {
        ("so", 5): (25, True),
        ("sl", 3): (18, True),
    }


def test_algebras_of_higher_rank_have_no_quaternions():
    assert quaternionic(named("so", 5)) is None
    assert quaternionic(named("su", 3)) is None


def test_a_wrong_product_is_noticed():
    found = quaternionic(named("so", 3))
    table = {**found.table, (1, 2): {3: -found.field.one}}
    assert not replace(found, table=table).sound
    assert not replace(found, star=[{0: found.field.one}] * 4).sound
    assert not replace(found, functional=[{0: found.field.one}, *found.functional[1:]]).sound
