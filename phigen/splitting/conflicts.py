"""Terms that do not commute must be in different parts: a colouring of the graph of conflicts.

By the rule of D. Brélaz (DSATUR, 1979), which finds two colours wherever two suffice, as in lattices.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from contextlib import nullcontext
from itertools import product

from phigen import progress
from phigen.splitting.flow import Term
from phigen.splitting.ring import Monomial, Ring
from phigen.symbolic.tower import Poly

#: So many pairs of terms are a stage of their own, for those who watch.
MANY = 100


class Conflicts:
    """Which terms of H commute. What is found of a term, and of two, is kept: groupings that are tried share most."""

    def __init__(self, ring: Ring) -> None:
        self.ring = ring
        self._kept: dict[int, Term] = {}  # so that the numbers of objects stay theirs
        self._supports: dict[int, frozenset[int]] = {}
        self._partners: dict[int, frozenset[int]] = {}
        self._monomials: dict[int, frozenset[Monomial]] = {}
        self._commute: dict[tuple[int, int], bool] = {}
        self._fields: dict[int, list[Poly]] = {}

    def support(self, term: Term) -> frozenset[int]:
        """The coordinates that a term depends on."""
        self._know(term)
        return self._supports[id(term)]

    def monomials(self, term: Term) -> frozenset[Monomial]:
        """The monomials of a term in what depends on the state."""
        self._know(term)
        if id(term) not in self._monomials:
            self._monomials[id(term)] = frozenset(self.ring.terms(term.element, self.ring.state))
        return self._monomials[id(term)]

    def graph(self, terms: Sequence[Term]) -> list[set[int]]:
        """For each term those that it does not commute with."""
        supports = [self.support(t) for t in terms]
        near = [self._partners[id(t)] for t in terms]
        pairs = [(i, j) for i in range(len(terms)) for j in range(i) if not near[i].isdisjoint(supports[j])]
        self._decide([(terms[i], terms[j]) for i, j in pairs])
        found: list[set[int]] = [set() for _ in terms]
        for i, j in pairs:
            if not self._commute[id(terms[i]), id(terms[j])]:
                found[i].add(j)
                found[j].add(i)
        return found

    def grouped(self, terms: Sequence[Term]) -> list[list[Term]]:
        """Terms in groups that commute, as few as the colouring finds."""
        neighbours = self.graph(terms)
        colours = coloured(neighbours, [self.support(t) for t in terms])
        return [[t for t, c in zip(terms, colours, strict=True) if c == k] for k in sorted(set(colours))]

    def _know(self, term: Term) -> None:
        if id(term) not in self._kept:
            self._kept[id(term)] = term
            support = self._supports[id(term)] = frozenset(self.ring.support(term.element))
            self._partners[id(term)] = frozenset(j for i in support for j in self.ring.brackets_of[i])

    def _decide(self, pairs: Sequence[tuple[Term, Term]]) -> None:
        """Whether the terms of each pair commute."""
        open_ = [(a, b) for a, b in pairs if (id(a), id(b)) not in self._commute]
        with progress.stage("pairs of terms", len(open_)) if len(open_) > MANY else nullcontext() as running:
            for k, (a, b) in enumerate(open_):
                self._commute[id(a), id(b)] = self._brackets_to_zero(a, b)
                if running:
                    running.done = k

    def _brackets_to_zero(self, a: Term, b: Term) -> bool:
        """Whether {a, b} = 0, proved, by the vector field of b, which is computed once."""
        if all(pair in self.ring.zero_pairs for pair in product(self.support(a), self.support(b))):
            return True
        if id(b) not in self._fields:
            self._know(b)
            self._fields[id(b)] = self.ring.field(b.element)
        return bool(self.ring.rate(a.element, self._fields[id(b)]) == 0)


def coloured(neighbours: Sequence[set[int]], supports: Sequence[Collection[int]]) -> list[int]:
    """A colour for each node, from 0; neighbours differ.

    Of the colours that a node may have it takes that of nodes with which it shares most of its support.
    """
    colours = [-1] * len(neighbours)
    seen: list[set[int]] = [set() for _ in neighbours]
    sharing: list[Counter[int]] = []  # for each colour how many nodes have a coordinate
    open_ = set(range(len(neighbours)))
    while open_:
        i = max(open_, key=lambda i: (len(seen[i]), len(neighbours[i]), -i))
        open_.remove(i)
        shared = [sum(users[k] for k in supports[i]) for users in sharing]
        free = [c for c in range(len(sharing)) if c not in seen[i]]
        colours[i] = max(free, key=lambda c: (shared[c], -c)) if free else len(sharing)
        if not free:
            sharing.append(Counter())
        sharing[colours[i]].update(supports[i])
        for j in neighbours[i]:
            seen[j].add(colours[i])
    return colours
