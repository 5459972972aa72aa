"""Blocks of π: groups of coordinates such that all brackets between two groups are 0.

For instance, the coordinates of each body of a system of bodies may form a block.
"""

from __future__ import annotations

from collections.abc import Sequence

from phigen.geometry.shapes import Matrix
from phigen.symbolic.expression import symbols_of


def blocks(coordinates: Sequence[str], poisson: Matrix) -> list[list[int]]:
    """Return the finest partition of the coordinates into blocks. A block is a sorted list of indices from 0.

    Coordinates of different blocks commute, and brackets within a block depend on coordinates of this block only. A
    coordinate that commutes with all others and occurs in no bracket is a block by itself.
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
