"""Star algebras (associative algebras with an involution) are found for Lie algebras of small rank, and their axioms
are decided in exact arithmetic.
"""

import random
from dataclasses import replace
from fractions import Fraction

import pytest
from support import slow_but

from phigen.gauss.enveloping import enveloping
from phigen.gauss.matrices import of_matrices
from phigen.gauss.quaternionic import quaternionic
from phigen.gauss.realisation import star_algebra
from phigen.geometry.families import named
from phigen.geometry.matrix_algebras import from_structure_constants
from phigen.symbolic.expression import number, symbol

#: Dimension of the star algebra for each Lie algebra: quaternions, two copies of them, dual quaternions, and algebras
#: for nilpotent and solvable Lie algebras.
DIMENSIONS = {
    ("so", 3): 4, ("su", 2): 4, ("sl", 2): 4, ("so", 4): 8, ("se", 3): 8, ("se", 2): 4, ("heisenberg", 2): 6,
    ("aff", 1): 3, ("gl", 2): 6,
}  # fmt: skip


def constants(brackets):
    """Return structure constants with expressions as entries, from {(i, j): {k: number}}."""
    structure_constants = {}
    for (i, j), row in brackets.items():
        structure_constants.setdefault(i, {})[j] = {k: number(v) for k, v in row.items()}
    return structure_constants


OSCILLATOR = from_structure_constants(4, constants({(0, 1): {2: 1}, (0, 2): {1: -1}, (1, 2): {3: 1}}))


@pytest.mark.parametrize(("family", "size"), DIMENSIONS)
def test_named_algebras_have_star_algebras(family, size):
    lie = named(family, size)
    algebra = quaternionic(lie)
    assert algebra is not None
    assert algebra.dimension == DIMENSIONS[family, size]
    assert algebra.sound
    for i in range(lie.dimension):
        for j in range(lie.dimension):
            expected = {}
            for k, c in lie.bracket(i, j).items():
                for at, v in algebra.basis[k].items():
                    expected[at] = expected.get(at, algebra.field.zero) + v * algebra.field.convert(c)
            expected = {at: v for at, v in expected.items() if v != 0}
            assert algebra.commutator(algebra.basis[i], algebra.basis[j]) == expected


def test_oscillator_algebra_has_a_star_algebra():
    algebra = quaternionic(OSCILLATOR)
    assert algebra is not None
    assert (algebra.dimension, algebra.sound) == (6, True)


def test_change_of_basis_with_parameters():
    """The brackets [a, b] = r·c, [b, c] = s·a, [c, a] = b/r with parameters r and s define so(3) or sl(2), depending on
    the sign of s. One star algebra of dimension 4 serves for both signs.
    """
    r, s = symbol("r"), symbol("s")
    lie = from_structure_constants(3, {0: {1: {2: r}, 2: {1: -1 / r}}, 1: {2: {0: s}}})
    algebra = quaternionic(lie)
    assert algebra is not None
    assert (algebra.dimension, algebra.sound) == (4, True)


def test_matrix_algebras_have_star_algebras_of_matrices():
    """so(5) preserves a form on R⁵, so its star algebra is that of 5×5 matrices. sl(3) and se(4) preserve no form, so
    their star algebras act on vectors and covectors.
    """
    algebras = {name: of_matrices(named(*name)) for name in (("so", 5), ("sl", 3), ("se", 4))}
    assert {name: a and (a.dimension, a.sound) for name, a in algebras.items()} == {
        ("so", 5): (25, True),
        ("sl", 3): (18, True),
        ("se", 4): (25, True),
    }


def test_algebras_of_higher_rank_have_no_quaternions():
    assert quaternionic(named("so", 5)) is None
    assert quaternionic(named("su", 3)) is None


def test_a_wrong_product_is_noticed():
    algebra = quaternionic(named("so", 3))
    table = {**algebra.table, (1, 2): {3: -algebra.field.one}}
    assert not replace(algebra, table=table).sound
    assert not replace(algebra, star=[{0: algebra.field.one}] * 4).sound
    assert not replace(algebra, functional=[{0: algebra.field.one}, *algebra.functional[1:]]).sound


def table_of(lie):
    """Return the brackets of basis elements as lists of fractions, by pairs of indices."""
    n = range(lie.dimension)
    rows = {(i, j): lie.bracket(i, j) for i in n for j in n}
    return {at: [Fraction(row[k].value) if k in row else Fraction(0) for k in n] for at, row in rows.items()}


def in_basis_of(lie, rows, back):
    """Return the direct sum of a Lie algebra and a centre, in a new basis. ``rows`` has the new basis vectors in the
    old basis, and ``back`` is the inverse matrix.
    """
    n, m = lie.dimension, len(rows)
    old = {at: [*row, *[Fraction(0)] * (m - n)] for at, row in table_of(lie).items()}
    new = {}
    for i in range(m):
        for j in range(i + 1, m):
            pairs = [(a, b) for a in range(n) for b in range(n) if rows[i][a] and rows[j][b]]
            bracket = [sum(rows[i][a] * rows[j][b] * old[a, b][k] for a, b in pairs) for k in range(m)]
            row = [sum(v * back[k][q] for k, v in enumerate(bracket)) for q in range(m)]
            new.setdefault(i, {})[j] = {k: number(v) for k, v in enumerate(row) if v}
    return from_structure_constants(m, new)


def scaled(lie, seed, centre=0):
    """Return the direct sum of a Lie algebra and a centre, in its old basis with vectors permuted and multiplied by
    integers.
    """
    m, source = lie.dimension + centre, random.Random(seed)
    places, factors = source.sample(range(m), m), [source.choice([1, 2, -1, 3]) for _ in range(m)]
    rows = [[Fraction(factors[i] * (places[i] == j)) for j in range(m)] for i in range(m)]
    back = [[Fraction(int(places[i] == j), factors[i]) for i in range(m)] for j in range(m)]
    return in_basis_of(lie, rows, back)


def rebased(lie, seed, centre=0):
    """Return the direct sum of a Lie algebra and a centre, in a basis with random integer coefficients."""
    m, source = lie.dimension + centre, random.Random(seed)
    rows = [[Fraction(int(i == j)) for j in range(m)] for i in range(m)]
    back = [list(row) for row in rows]
    for _ in range(2 * m):
        i, j = source.sample(range(m), 2)
        sign = source.choice([-1, 1])
        rows[i] = [a + sign * b for a, b in zip(rows[i], rows[j], strict=True)]
        for row in back:
            row[j] -= sign * row[i]
    return in_basis_of(lie, rows, back)


SO31 = from_structure_constants(6, constants({
    (0, 1): {2: 1}, (0, 2): {1: -1}, (1, 2): {0: 1}, (0, 4): {5: 1}, (0, 5): {4: -1}, (1, 3): {5: -1}, (1, 5): {3: 1},
    (2, 3): {4: 1}, (2, 4): {3: -1}, (3, 4): {2: -1}, (3, 5): {1: 1}, (4, 5): {0: -1},
}))  # fmt: skip

#: Lie algebras, the dimension of a centre to be added (for instance to su(n) for u(n)), and the dimension of the star
#: algebra. phigen finds those of `ANY_BASIS` in any basis, those of `SPARSE_BASIS` only in bases with few structure
#: constants.
ANY_BASIS = {
    "so(3)": (named("so", 3), 0, 4), "so(4)": (named("so", 4), 0, 8), "so(3,1)": (SO31, 0, 8),
    "sl(2)": (named("sl", 2), 0, 4), "se(3)": (named("se", 3), 0, 8), "heisenberg(2)": (named("heisenberg", 2), 0, 6),
    "oscillator": (OSCILLATOR, 0, 6), "gl(2)": (named("gl", 2), 0, 6), "u(2)": (named("su", 2), 1, 6),
    "sp(2)": (named("sp", 2), 0, 4), "se(4)": (named("se", 4), 0, 25),
}  # fmt: skip
SPARSE_BASIS = {
    "so(5)": (named("so", 5), 0, 16), "su(3)": (named("su", 3), 0, 18), "u(3)": (named("su", 3), 1, 18),
    "gl(3)": (named("gl", 3), 0, 18), "sl(3)": (named("sl", 3), 0, 18), "sp(4)": (named("sp", 4), 0, 16),
}  # fmt: skip
CASES = [(k, rebased) for k in ANY_BASIS] + [(k, scaled) for k in SPARSE_BASIS]
FAST = [("so(3)", rebased), ("so(3,1)", rebased), ("u(2)", rebased), ("u(3)", scaled)]


@pytest.mark.parametrize(("name", "change"), slow_but(FAST, CASES))
def test_members_of_families_are_found_in_other_bases(name, change):
    standard, centre, dimension = (ANY_BASIS | SPARSE_BASIS)[name]
    lie = change(standard, 3, centre)
    algebra = star_algebra(lie)
    assert algebra is not None
    assert (algebra.dimension, algebra.sound) == (dimension, True)
    for i in range(lie.dimension):
        for j in range(i):
            expected = {}
            for k, c in lie.bracket(i, j).items():
                for at, v in algebra.basis[k].items():
                    expected[at] = expected.get(at, algebra.field.zero) + v * algebra.field.convert(c)
            assert algebra.commutator(algebra.basis[i], algebra.basis[j]) == {
                at: v for at, v in expected.items() if v != 0
            }


@pytest.mark.slow
def test_dense_bases_of_higher_rank_would_make_too_much_code():
    assert star_algebra(rebased(named("so", 5), 3)) is None


@pytest.mark.parametrize(("family", "size"), [("sp", 4), ("su", 3), ("gl", 3)])
def test_enveloping_algebras_have_their_quotient(family, size):
    quotient = enveloping(named(family, size))
    assert quotient is not None
    assert quotient.sound
    assert enveloping(named("se", 3)) is None  # se(3) is not simple
    assert enveloping(named("so", 4)) is None
