"""Decomposition of Lie algebras into commuting ideals, which need not be spanned by elements of the basis."""

import pytest
from geometry.building import family, system

from phigen.geometry.ideals import applied, ideal_projections


def product(a, b):
    return [applied(a, column, 0) for column in zip(*b, strict=True)]


@pytest.mark.parametrize(
    ("name", "size", "ranks"),
    [("so", 3, [3]), ("so", 4, [3, 3]), ("gl", 2, [3, 1]), ("gl", 3, [8, 1]), ("se", 3, [6]), ("so", 5, [10])],
)
def test_projections_are_onto_commuting_ideals(name, size, ranks):
    algebra = family(name, size).lie_algebra
    projections = ideal_projections(algebra)
    # The trace of a projection is its rank.
    assert sorted((sum(p[i][i] for i in range(len(p))) for p in projections), reverse=True) == ranks
    n = algebra.dimension
    for a, p in enumerate(projections):
        for b, q in enumerate(projections):
            columns = product(p, q)
            assert all(columns[j][i] == (p[i][j] if a == b else 0) for i in range(n) for j in range(n))


def test_constants_with_parameters_are_left_alone():
    s = system("x y z", "{brackets: {x: {y: a*z, z: -y}, y: {z: x}}}", extra="parameters: {a: 2}")
    assert len(ideal_projections(s.lie_algebra)) == 1
