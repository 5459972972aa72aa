"""Blocks of π: groups of coordinates without brackets between them, such as several bodies, or a spin and a
particle."""

from __future__ import annotations

from collections.abc import Sequence

from phigen.geometry.shapes import Matrix
from phigen.symbolic.expression import symbols_of


def blocks(coordinates: Sequence[str], poisson: Matrix) -> list[list[int]]:
    """Return the finest partition of the coordinates into blocks, as sorted lists of indices from 0.

    Coordinates of different blocks commute, and brackets in a block only depend on coordinates of this block. A
    coordinate that commutes with all others and occurs in no bracket is a block of its own.
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
