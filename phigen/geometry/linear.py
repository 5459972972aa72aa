"""Exact linear algebra with sparse vectors over a `Field`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from phigen.geometry.field import Field, Scalar

Key = TypeVar("Key", bound=Any)


@dataclass
class _Row(Generic[Key]):
    pivot: Key
    entries: dict[Key, Scalar]  # 1 at the pivot
    combination: dict[int, Scalar]  # of the given vectors


class Span(Generic[Key]):
    """The span of sparse vectors (key → non-zero scalar), with coordinates in terms of them.

    ``dependent`` lists the positions of vectors that are combinations of earlier ones.
    """

    def __init__(self, field: Field, vectors: Iterable[Mapping[Key, Scalar]]) -> None:
        self._field = field
        self._rows: list[_Row[Key]] = []
        self.dependent: list[int] = []
        for position, vector in enumerate(vectors):
            if not self._insert(position, vector):
                self.dependent.append(position)

    @property
    def dimension(self) -> int:
        """Dimension of the span."""
        return len(self._rows)

    def coordinates(self, vector: Mapping[Key, Scalar]) -> dict[int, Scalar] | None:
        """c with vector = Σ c[i]·vectors[i], only non-zero c[i]; None if the vector is not in the span."""
        rest, combination = self._reduce(vector)
        return None if rest else {i: -c for i, c in sorted(combination.items())}

    def _insert(self, position: int, vector: Mapping[Key, Scalar]) -> bool:
        rest, combination = self._reduce(vector)
        if not rest:
            return False
        one = self._field.one
        pivot = min(sorted(rest), key=lambda k: 0 if rest[k] == one or -rest[k] == one else 1)
        scale = one / rest[pivot]
        combination[position] = one
        entries = {k: v * scale for k, v in rest.items()}
        combination = {i: c * scale for i, c in combination.items()}
        for row in self._rows:
            if pivot in row.entries:
                factor = row.entries[pivot]
                add_multiple(row.entries, entries, -factor)
                add_multiple(row.combination, combination, -factor)
        self._rows.append(_Row(pivot, entries, combination))
        return True

    def _reduce(self, vector: Mapping[Key, Scalar]) -> tuple[dict[Key, Scalar], dict[int, Scalar]]:
        rest = {k: v for k, v in vector.items() if v != 0}
        combination: dict[int, Scalar] = {}
        for row in self._rows:
            factor = rest.get(row.pivot)
            if factor is not None:
                add_multiple(rest, row.entries, -factor)
                add_multiple(combination, row.combination, -factor)
        return rest, combination


def add_multiple(target: dict[Key, Scalar], source: Mapping[Key, Scalar], factor: Scalar) -> None:
    """target += factor·source, in place; entries that become 0 disappear."""
    for k, v in source.items():
        value = target[k] + factor * v if k in target else factor * v
        if value == 0:
            target.pop(k, None)
        else:
            target[k] = value


def kernel(field: Field, rows: Sequence[Mapping[int, Scalar]], size: int) -> list[dict[int, Scalar]]:
    """A basis of the vectors v of length ``size`` with Σ_k row[k]·v[k] = 0 for all rows, in reduced form."""
    reduced: list[tuple[int, dict[int, Scalar]]] = []
    for row in rows:
        rest = {k: v for k, v in row.items() if v != 0}
        for pivot, known in reduced:
            if pivot in rest:
                add_multiple(rest, known, -rest[pivot])
        if not rest:
            continue
        pivot = min(rest)
        scale = field.one / rest[pivot]
        rest = {k: v * scale for k, v in rest.items()}
        for _, known in reduced:
            if pivot in known:
                add_multiple(known, rest, -known[pivot])
        reduced.append((pivot, rest))
    pivots = {pivot for pivot, _ in reduced}
    basis = []
    for free in range(size):
        if free not in pivots:
            vector = {pivot: -row[free] for pivot, row in reduced if free in row}
            basis.append(vector | {free: field.one})
    return basis
