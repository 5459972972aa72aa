"""Lie algebras, given by structure constants, with faithful matrices if these are known.

The structure constants c_ij^k are defined by [E_i, E_j] = Σ_k c_ij^k E_k. On the dual, {x_i, x_j} = Σ_k c_ij^k x_k.
With ``sign: minus`` in a spec, all c_ij^k are negated. If matrices ρ(E_i) represent an algebra, then −ρ(E_i) represent
the algebra with the negated constants.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from phigen.geometry.field import Field, Scalar
from phigen.symbolic.expression import Expression, symbol, total

#: Sparse vector and sparse matrix: index, or (row, column), → nonzero scalar.
Vector = dict[int, Scalar]
SparseMatrix = dict[tuple[int, int], Scalar]


@dataclass(frozen=True)
class Representation:
    """Matrices ρ(E_i) with ρ([E_i, E_j]) = [ρ(E_i), ρ(E_j)]; each maps (row, column) → nonzero entry."""

    name: str
    size: int
    matrices: tuple[Mapping[tuple[int, int], Expression], ...]


@dataclass(frozen=True)
class LieAlgebra:
    """Lie algebra over Q(parameters) with a basis E_1 … E_n.

    ``constants[(i, j)][k]`` is c_ij^k for i < j; zeros are left out, and c_ji^k = −c_ij^k. ``representation`` has
    faithful matrices if the spec or the named family provides them, else it is None. ``labels`` are names of the E_i
    for messages.
    """

    name: str
    dimension: int
    constants: Mapping[tuple[int, int], Mapping[int, Expression]]
    representation: Representation | None = None
    labels: tuple[str, ...] = field(default=())

    def bracket(self, i: int, j: int) -> Mapping[int, Expression]:
        """Return [E_i, E_j] as a map k → c_ij^k, without zeros."""
        if i == j:
            return {}
        if i < j:
            return self.constants.get((i, j), {})
        return {k: -c for k, c in self.constants.get((j, i), {}).items()}

    def label(self, i: int) -> str:
        """Return the name of E_i for messages."""
        return self.labels[i] if self.labels else f"E{i + 1}"

    @cached_property
    def field(self) -> Field:
        """The smallest field, in the sense of algebra, that contains the structure constants."""
        return Field(c for row in self.constants.values() for c in row.values())

    def poisson(self, coordinates: Sequence[str]) -> tuple[tuple[Expression, ...], ...]:
        """Return the Lie–Poisson tensor π_ij = Σ_k c_ij^k x_k, an n×n matrix."""
        x = [symbol(c) for c in coordinates]
        n = range(self.dimension)
        return tuple(tuple(total(c * x[k] for k, c in sorted(self.bracket(i, j).items())) for j in n) for i in n)

    def opposite(self) -> LieAlgebra:
        """Return the algebra with the negated bracket. The matrices −ρ(E_i) represent it."""
        rep = self.representation
        if rep is not None:
            negated = tuple({position: -v for position, v in m.items()} for m in rep.matrices)
            rep = Representation(f"minus {rep.name}", rep.size, negated)
        constants = {ij: {k: -c for k, c in row.items()} for ij, row in self.constants.items()}
        return LieAlgebra(f"{self.name} with sign minus", self.dimension, constants, rep, self.labels)
