"""Decomposition of a Lie algebra into a direct sum of ideals, as in so(4) = so(3) ⊕ so(3).

The elements of the basis need not lie in the ideals. The projections onto the ideals commute with every ad_X. So they
lie in the centroid, the space of linear maps T with T[X, Y] = [TX, Y]. The projections are found from primary
decompositions of elements of the centroid over Q.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from flint import fmpq_mat, fmpq_poly

from phigen.geometry.field import Scalar
from phigen.geometry.lie_algebra import LieAlgebra
from phigen.geometry.linear import kernel
from phigen.symbolic.tower import rational

#: Largest dimension n of an algebra that is decomposed: the linear equations for its centroid have n² unknowns.
LARGEST = 12

Rows = tuple[tuple[Fraction, ...], ...]


def ideal_projections(algebra: LieAlgebra) -> list[Rows]:
    """Return projections e_1, …, e_r onto ideals whose direct sum is the algebra: Σ e_a = 1, and e_a e_b = 0
    for a ≠ b.

    Each projection is a matrix in the basis E_i, as a list of rows; its column j is the image of E_j. The identity is
    the only result if the algebra is indecomposable or large, or if its structure constants contain parameters.
    """
    n = algebra.dimension
    parts = [_identity(n)]
    if n > LARGEST or not algebra.field.is_rational:
        return [_rows(p) for p in parts]
    for element in _centroid(algebra):
        for idempotent in _idempotents(element):
            parts = [q for p in parts for q in _refined(p, idempotent)]
    return [_rows(p) for p in parts]


def _refined(part: Any, idempotent: Any) -> list[Any]:
    ideal = part * idempotent
    if ideal != idempotent * part or ideal * ideal != ideal:
        return [part]
    return [p for p in (ideal, part - ideal) if p.rank()]


def _centroid(algebra: LieAlgebra) -> list[Any]:
    """Return a basis of the centroid, the matrices T with T[E_i, E_j] = [TE_i, E_j] for all i, j."""
    n, field = algebra.dimension, algebra.field
    constants = [[{k: field.convert(c) for k, c in algebra.bracket(i, j).items()} for j in range(n)] for i in range(n)]
    equations = []
    for i in range(n):
        for j in range(n):
            rows: list[dict[int, Scalar]] = [{} for _ in range(n)]
            for k, c in constants[i][j].items():  # T[E_i, E_j]; T_mk is unknown number m·n + k
                for m in range(n):
                    rows[m][m * n + k] = rows[m].get(m * n + k, field.zero) + c
            for a in range(n):  # minus [TE_i, E_j] = Σ_a T_ai [E_a, E_j]
                for m, c in constants[a][j].items():
                    rows[m][a * n + i] = rows[m].get(a * n + i, field.zero) - c
            equations += [row for row in rows if row]
    return [fmpq_mat(n, n, [v.get(m, field.zero) for m in range(n * n)]) for v in kernel(field, equations, n * n)]


def _idempotents(element: Any) -> list[Any]:
    """Return the projections onto the primary components of a matrix over Q; [] if there is only one component."""
    minimal = element.minpoly()
    _, factors = minimal.factor()
    if len(factors) < 2:
        return []
    idempotents = []
    for factor, multiplicity in factors:
        primary = factor**multiplicity
        other_factor = fmpq_poly(minimal / primary)
        _, _, cofactor = primary.xgcd(other_factor)
        idempotents.append(_value(cofactor * other_factor, element))
    return idempotents


def _value(polynomial: Any, matrix: Any) -> Any:
    result = fmpq_mat(matrix.nrows(), matrix.ncols())
    for c in reversed(polynomial.coeffs()):
        result = result * matrix + _identity(matrix.nrows()) * c
    return result


def _identity(n: int) -> Any:
    return fmpq_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])


def _rows(matrix: Any) -> Rows:
    n = matrix.nrows()
    return tuple(tuple(rational(matrix[i, j]) for j in range(n)) for i in range(n))


def applied(rows: Sequence[Sequence[Fraction]], vector: Sequence[Any], zero: Any) -> list[Any]:
    """Return the product of a matrix of rational numbers and a vector of expressions."""
    return [sum((c * v for c, v in zip(row, vector, strict=True) if c), zero) for row in rows]
