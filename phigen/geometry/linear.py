"""Exact linear algebra for sparse vectors with entries in a `Field`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import gcd, lcm
from typing import Any, Generic, TypeVar

from phigen.geometry.field import Field, Scalar
from phigen.symbolic.expression import Expression
from phigen.symbolic.tower import rational

Key = TypeVar("Key", bound=Any)


@dataclass
class _Row(Generic[Key]):
    pivot: Key
    entries: dict[Key, Scalar]  # key → entry; 1 at the pivot
    combination: dict[int, Scalar]  # coefficients with which the vectors of the span add up to the row


class Span(Generic[Key]):
    """The span of some sparse vectors (key → nonzero scalar).

    The method `coordinates` expresses an element of the span by these vectors. ``dependent`` has the positions of the
    vectors that are linear combinations of earlier ones.
    """

    def __init__(self, field: Field, vectors: Iterable[Mapping[Key, Scalar]]) -> None:
        self._field = field
        self._rows: list[_Row[Key]] = []
        self._by_pivot: dict[Key, _Row[Key]] = {}
        self.dependent: list[int] = []
        for position, vector in enumerate(vectors):
            if not self._insert(position, vector):
                self.dependent.append(position)

    @property
    def dimension(self) -> int:
        """The dimension of the span."""
        return len(self._rows)

    def coordinates(self, vector: Mapping[Key, Scalar]) -> dict[int, Scalar] | None:
        """Return the coefficients c with vector = Σ c[i]·vectors[i], without zeros; None if the vector is not in the
        span."""
        remainder, combination = self._reduce(vector)
        return None if remainder else {i: -c for i, c in sorted(combination.items())}

    def _insert(self, position: int, vector: Mapping[Key, Scalar]) -> bool:
        remainder, combination = self._reduce(vector)
        if not remainder:
            return False
        unit = self._field.one
        pivot = min(sorted(remainder), key=lambda k: 0 if remainder[k] == unit or -remainder[k] == unit else 1)
        scale = unit / remainder[pivot]
        combination[position] = unit
        entries = {k: v * scale for k, v in remainder.items()}
        combination = {i: c * scale for i, c in combination.items()}
        for row in self._rows:
            if pivot in row.entries:
                factor = row.entries[pivot]
                add_multiple(row.entries, entries, -factor)
                add_multiple(row.combination, combination, -factor)
        row = self._by_pivot[pivot] = _Row(pivot, entries, combination)
        self._rows.append(row)
        return True

    def _reduce(self, vector: Mapping[Key, Scalar]) -> tuple[dict[Key, Scalar], dict[int, Scalar]]:
        remainder = {k: v for k, v in vector.items() if v != 0}
        combination: dict[int, Scalar] = {}
        # No row has an entry at the pivot of another row. So eliminating a pivot brings in no further pivots, and one
        # pass over the pivots in the vector suffices.
        for row, factor in [(self._by_pivot[k], v) for k, v in remainder.items() if k in self._by_pivot]:
            add_multiple(remainder, row.entries, -factor)
            add_multiple(combination, row.combination, -factor)
        return remainder, combination


def add_multiple(target: dict[Key, Scalar], source: Mapping[Key, Scalar], factor: Scalar) -> None:
    """Add ``factor``·``source`` to the sparse vector ``target`` in place; entries that become 0 are removed."""
    for k, v in source.items():
        value = target[k] + factor * v if k in target else factor * v
        if value == 0:
            target.pop(k, None)
        else:
            target[k] = value


def kernel(field: Field, rows: Sequence[Mapping[int, Scalar]], size: int) -> list[dict[int, Scalar]]:
    """Return a basis of the kernel: the vectors v of length ``size`` with Σ_k row[k]·v[k] = 0 for all rows.

    Each basis vector is 1 at its last nonzero position, where all other basis vectors are 0.
    """
    echelon: dict[int, dict[int, Scalar]] = {}
    for row in sorted(rows, key=len):
        remainder = {k: v for k, v in row.items() if v != 0}
        while remainder:
            pivot = min(remainder)
            pivot_row = echelon.get(pivot)
            if pivot_row is None:
                scale = field.one / remainder[pivot]
                echelon[pivot] = {k: v * scale for k, v in remainder.items()}
                break
            add_multiple(remainder, pivot_row, -remainder[pivot])
        if len(echelon) == size:
            return []
    for pivot in sorted(echelon, reverse=True):
        row = echelon[pivot]
        for k in sorted(k for k in row if k > pivot and k in echelon):
            add_multiple(row, echelon[k], -row[k])
    return [
        {pivot: -row[free_column] for pivot, row in sorted(echelon.items()) if free_column in row}
        | {free_column: field.one}
        for free_column in range(size)
        if free_column not in echelon
    ]


def coprime_integers(vector: Mapping[Any, Scalar]) -> dict[Any, int]:
    """Return the multiple of a vector over Q whose entries are coprime integers.

    The entry with the smallest key is positive.
    """
    exact = {k: rational(v) for k, v in sorted(vector.items())}
    scale = lcm(*(v.denominator for v in exact.values()))
    integers = {k: int(v * scale) for k, v in exact.items()}
    common = gcd(*integers.values())
    sign = 1 if next(iter(integers.values())) > 0 else -1
    return {k: sign * v // common for k, v in integers.items()}


def inverse_matrix(rows: Sequence[Sequence[Expression]]) -> tuple[tuple[Expression, ...], ...]:
    """Return the inverse of a square matrix of expressions, with entries in lowest terms.

    Functions of symbols count as independent symbols, as in `Field`. Raises `ZeroDivisionError` if the matrix is
    singular.
    """
    field = Field(e for row in rows for e in row)
    n = len(rows)
    left = [[field.convert(e) for e in row] for row in rows]
    right = [[field.number(int(i == j)) for j in range(n)] for i in range(n)]
    for k in range(n):
        pivot = next((i for i in range(k, n) if left[i][k] != 0), None)
        if pivot is None:
            raise ZeroDivisionError("the matrix is singular")
        for side in (left, right):
            side[k], side[pivot] = side[pivot], side[k]
        scale = field.one / left[k][k]
        left[k], right[k] = ([v * scale for v in side[k]] for side in (left, right))
        for i in range(n):
            factor = left[i][k]
            if i != k and factor != 0:
                for side in (left, right):
                    side[i] = [v - factor * w for v, w in zip(side[i], side[k], strict=True)]
    return tuple(tuple(field.expression(v) for v in row) for row in right)
