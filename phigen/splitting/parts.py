"""Which terms of H go together: as few parts as possible, each of terms that commute and have elementary flows.

Terms that do not commute must be in different parts: a colouring of the graph of conflicts, by the rule of D. Brélaz
(DSATUR, 1979), which finds two colours wherever two suffice, as in lattices.
"""

from __future__ import annotations

from dataclasses import dataclass

from phigen.errors import Diagnostic, SpecError
from phigen.geometry.system import System
from phigen.splitting.flow import Flow, NoFlowError, Term, flow_of
from phigen.splitting.ring import Ring, ring_of
from phigen.splitting.terms import hamiltonian_terms, terms_of
from phigen.symbolic.expression import text


@dataclass(frozen=True)
class Splitting:
    """The flows of the parts of H, in the order of a step."""

    flows: tuple[Flow, ...]


def split(system: System) -> Splitting:
    """H as a sum of parts with elementary flows.

    Raises `SpecError`, located at the Hamiltonian, that names the term that stands in the way.
    """
    listed = hamiltonian_terms(system)
    ring = ring_of(system, listed)
    terms = terms_of(ring, listed)
    colours = coloured(conflicts(ring, terms))
    try:
        flows = [
            flow_of(ring, [t for t, c in zip(terms, colours, strict=True) if c == k]) for k in sorted(set(colours))
        ]
    except NoFlowError as error:
        raise _refusal(system, error) from None
    return Splitting(tuple(flows))


def conflicts(ring: Ring, terms: list[Term]) -> list[set[int]]:
    """For each term those that it does not commute with."""
    found: list[set[int]] = [set() for _ in terms]
    for i, a in enumerate(terms):
        for j in range(i):
            if not ring.commute(a.element, terms[j].element):
                found[i].add(j)
                found[j].add(i)
    return found


def coloured(neighbours: list[set[int]]) -> list[int]:
    """A colour for each node, from 0; neighbours differ."""
    colours = [-1] * len(neighbours)
    for _ in neighbours:
        open_ = [i for i, c in enumerate(colours) if c < 0]
        seen = {i: {colours[j] for j in neighbours[i]} - {-1} for i in open_}
        i = max(open_, key=lambda i: (len(seen[i]), len(neighbours[i]), -i))
        colours[i] = next(c for c in range(len(neighbours)) if c not in seen[i])
    return colours


def _refusal(system: System, error: NoFlowError) -> SpecError:
    place = system.locations.get(("hamiltonian",))
    message = f"scheme splitting: the term {text(error.term.expression)} has no elementary flow: {error.reason}"
    hint = "scheme: series takes every H; terms in coordinates that commute with one another always split"
    return SpecError([Diagnostic(message, place, hint)])
