"""Grouping of the terms of H into sums of commuting terms, by colouring a graph. The edges of the graph join terms that
do not commute.

The algorithm is that of D. Brélaz (DSATUR, 1979). It uses two colours wherever two are sufficient, as on many lattices.
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

#: Progress is displayed if phigen must decide for more than this number of pairs of terms whether they commute.
MIN_PAIRS_FOR_PROGRESS = 100


class Conflicts:
    """Cache of the decisions whether two terms of H commute.

    Many candidate groupings of H contain the same terms, so results for a term and for a pair are stored.
    """

    def __init__(self, ring: Ring) -> None:
        self.ring = ring
        self._terms: dict[int, Term] = {}  # results are stored by id, so the terms must stay alive
        self._supports: dict[int, frozenset[int]] = {}
        self._partners: dict[int, frozenset[int]] = {}
        self._monomials: dict[int, frozenset[Monomial]] = {}
        self._commute: dict[tuple[int, int], bool] = {}
        self._fields: dict[int, list[Poly]] = {}

    def support(self, term: Term) -> frozenset[int]:
        """Return the indices of the coordinates on which a term depends."""
        self._know(term)
        return self._supports[id(term)]

    def monomials(self, term: Term) -> frozenset[Monomial]:
        """Return the exponents of the monomials of a term in the variables that depend on coordinates."""
        self._know(term)
        if id(term) not in self._monomials:
            self._monomials[id(term)] = frozenset(self.ring.terms(term.element, self.ring.state))
        return self._monomials[id(term)]

    def graph(self, terms: Sequence[Term]) -> list[set[int]]:
        """Return, for each term, the indices of the terms with which it does not commute."""
        supports = [self.support(t) for t in terms]
        partners = [self._partners[id(t)] for t in terms]
        pairs = [(i, j) for i in range(len(terms)) for j in range(i) if not partners[i].isdisjoint(supports[j])]
        self._decide([(terms[i], terms[j]) for i, j in pairs])
        conflicts: list[set[int]] = [set() for _ in terms]
        for i, j in pairs:
            if not self._commute[id(terms[i]), id(terms[j])]:
                conflicts[i].add(j)
                conflicts[j].add(i)
        return conflicts

    def grouped(self, terms: Sequence[Term]) -> list[list[Term]]:
        """Return the terms in groups of commuting terms. Each group has the terms of one colour (see `coloured`)."""
        neighbours = self.graph(terms)
        colours = coloured(neighbours, [self.support(t) for t in terms])
        return [[t for t, c in zip(terms, colours, strict=True) if c == k] for k in sorted(set(colours))]

    def _know(self, term: Term) -> None:
        if id(term) not in self._terms:
            self._terms[id(term)] = term
            support = self._supports[id(term)] = frozenset(self.ring.support(term.element))
            self._partners[id(term)] = frozenset(j for i in support for j in self.ring.brackets_of[i])

    def _decide(self, pairs: Sequence[tuple[Term, Term]]) -> None:
        """Decide for each pair of terms whether they commute, and store the results."""
        open_ = [(a, b) for a, b in pairs if (id(a), id(b)) not in self._commute]
        with (
            progress.stage("pairs of terms", len(open_))
            if len(open_) > MIN_PAIRS_FOR_PROGRESS
            else nullcontext() as running
        ):
            for k, (a, b) in enumerate(open_):
                self._commute[id(a), id(b)] = self._brackets_to_zero(a, b)
                if running:
                    running.done = k

    def _brackets_to_zero(self, a: Term, b: Term) -> bool:
        """Whether {a, b} = 0 is proved; the vector field of b is computed once and stored."""
        if all(pair in self.ring.zero_pairs for pair in product(self.support(a), self.support(b))):
            return True
        if id(b) not in self._fields:
            self._know(b)
            self._fields[id(b)] = self.ring.field(b.element)
        return bool(self.ring.rate(a.element, self._fields[id(b)]) == 0)


def coloured(neighbours: Sequence[set[int]], supports: Sequence[Collection[int]]) -> list[int]:
    """Return a colour, from 0 on, for each node of a graph, such that neighbours have different colours.

    ``supports`` has the coordinates of each node. Among the possible colours, a node gets the colour of those nodes
    with which it shares the most coordinates.
    """
    colours = [-1] * len(neighbours)
    neighbour_colours: list[set[int]] = [set() for _ in neighbours]
    sharing: list[Counter[int]] = []  # for each colour: coordinate → number of nodes with this colour and coordinate
    uncoloured = set(range(len(neighbours)))
    while uncoloured:
        i = max(uncoloured, key=lambda i: (len(neighbour_colours[i]), len(neighbours[i]), -i))
        uncoloured.remove(i)
        usage = [sum(users[k] for k in supports[i]) for users in sharing]
        free_colours = [c for c in range(len(sharing)) if c not in neighbour_colours[i]]
        colours[i] = max(free_colours, key=lambda c: (usage[c], -c)) if free_colours else len(sharing)
        if not free_colours:
            sharing.append(Counter())
        sharing[colours[i]].update(supports[i])
        for j in neighbours[i]:
            neighbour_colours[j].add(colours[i])
    return colours
