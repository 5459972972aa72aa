"""Block-diagonal π: groups of coordinates without brackets between them (several bodies, spin and particle)."""

from __future__ import annotations

from collections.abc import Sequence

from phigen.geometry.shapes import Matrix
from phigen.symbolic.expression import symbols_of


def blocks(coordinates: Sequence[str], poisson: Matrix) -> list[list[int]]:
    """The finest partition into groups with {x_i, x_j} = 0 between them and brackets of their own coordinates only.

    Indices from 0, sorted; a coordinate that commutes with all others and occurs in no bracket is a group by itself.
    """
    index = {c: i for i, c in enumerate(coordinates)}
    part = list(range(len(coordinates)))
    for i, row in enumerate(poisson):
        for j, entry in enumerate(row[:i]):
            if entry.is_zero:
                continue
            together = {part[m] for m in (i, j, *(index[s] for s in symbols_of(entry) if s in index))}
            part = [min(together) if label in together else label for label in part]
    return [[i for i, label in enumerate(part) if label == root] for root in sorted(set(part))]
