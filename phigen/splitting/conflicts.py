"""Terms that do not commute must be in different parts: a colouring of the graph of conflicts.

By the rule of D. Brélaz (DSATUR, 1979), which finds two colours wherever two suffice, as in lattices.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from phigen.splitting.flow import Term
from phigen.splitting.ring import Ring


def conflicts(ring: Ring, terms: Sequence[Term]) -> list[set[int]]:
    """For each term those that it does not commute with."""
    found: list[set[int]] = [set() for _ in terms]
    for i, a in enumerate(terms):
        for j in range(i):
            if not ring.commute(a.element, terms[j].element):
                found[i].add(j)
                found[j].add(i)
    return found


def coloured(neighbours: Sequence[set[int]], supports: Sequence[Collection[int]]) -> list[int]:
    """A colour for each node, from 0; neighbours differ.

    Of the colours that a node may have it takes that of nodes with which it shares most of its support.
    """
    colours = [-1] * len(neighbours)
    for _ in neighbours:
        open_ = [i for i, c in enumerate(colours) if c < 0]
        seen = {i: {colours[j] for j in neighbours[i]} - {-1} for i in open_}
        i = max(open_, key=lambda i: (len(seen[i]), len(neighbours[i]), -i))
        used = max(colours) + 1
        shared = [0] * used
        for j, c in enumerate(colours):
            if c >= 0:
                shared[c] += len(set(supports[i]) & set(supports[j]))
        free = [c for c in range(used) if c not in seen[i]]
        colours[i] = max(free, key=lambda c: (shared[c], -c)) if free else used
    return colours


def grouped(ring: Ring, terms: Sequence[Term]) -> list[list[Term]]:
    """Terms in groups that commute, as few as the colouring finds."""
    supports = [ring.support(t.element) for t in terms]
    colours = coloured(conflicts(ring, terms), supports)
    return [[t for t, c in zip(terms, colours, strict=True) if c == k] for k in sorted(set(colours))]
