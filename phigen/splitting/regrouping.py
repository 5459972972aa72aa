"""Other forms of H as a sum of terms, which may need fewer parts.

*Companions* are functions C whose multiples may be subtracted from some terms and added as a separate term: H = λC + (H
− λC). A suitable λ cancels a term that does not commute with others. For example, the free rigid body then has two
parts instead of three. C is a Casimir of π, whose flow changes nothing, or a Casimir of a sub-bracket. A sub-bracket
consists of the brackets of some coordinates, if these brackets depend on no other coordinates. An example of C on
se(3)* is |m|² with the angular momentum m, since |m|² commutes with every function of m.

*Blocks.* Terms that couple the same blocks of π, such as products of the components of two spins, are summed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from phigen.geometry.blocks import blocks
from phigen.geometry.polynomial_casimirs import polynomial_casimirs
from phigen.geometry.shapes import General
from phigen.geometry.system import System
from phigen.splitting.conflicts import Conflicts
from phigen.splitting.flow import Term
from phigen.splitting.ring import Ring
from phigen.splitting.terms import joined, monomial_terms
from phigen.symbolic.expression import Expression, total
from phigen.symbolic.tower import Poly

#: Largest number of coordinates of a sub-bracket whose Casimirs are computed. `_companions` explains sub-brackets.
MOST_COORDINATES = 8


def with_companions(system: System, conflicts: Conflicts, terms: Sequence[Term]) -> Iterator[list[Term]]:
    """Yield lists of terms in which a multiple λC is subtracted from terms, and added again as a separate term.

    C runs through the companions, which `_companions` finds. λ runs through the values for which λC cancels a monomial
    of H.
    """
    ring = conflicts.ring
    for companion in _companions(system, conflicts, terms):
        of_companion = ring.terms(companion.element, ring.state)
        affected = [t for t in terms if not conflicts.monomials(t).isdisjoint(of_companion)]
        if not affected:
            continue
        other_terms = [t for t in terms if t not in affected]
        sum_of_affected = ring.tower.combine(t.element for t in affected)
        monomials_present = ring.terms(sum_of_affected, ring.state)
        multiples: list[Poly] = []
        for monomial, coefficient in of_companion.items():
            inverse = ring.tower.inverse(coefficient) if monomial in monomials_present else None
            if inverse is not None:
                multiple = ring.tower.combine([monomials_present[monomial] * inverse])
                if multiple not in multiples:
                    multiples.append(multiple)
        for multiple in multiples:
            remainder = ring.tower.combine([sum_of_affected, -multiple * companion.element])
            subtracted = Term(ring.expression(multiple) * companion.expression, multiple * companion.element)
            yield [*other_terms, *joined(ring, monomial_terms(ring, remainder)), subtracted]


def _companions(system: System, conflicts: Conflicts, terms: Sequence[Term]) -> Iterator[Term]:
    """Yield functions C whose multiples may be subtracted from terms: Casimirs of π, and quadratic Casimirs of
    sub-brackets.

    Any two terms that do not commute define a sub-bracket: the brackets within the smallest set of coordinates that
    contains the coordinates of both terms and is closed under brackets.
    """
    ring, candidates = conflicts.ring, list(system.casimirs.values())
    closures: set[tuple[int, ...]] = set()
    for i, neighbours in enumerate(conflicts.graph(terms)):
        for j in sorted(n for n in neighbours if n < i):
            closure = _closure(ring, {*conflicts.support(terms[i]), *conflicts.support(terms[j])})
            if len(closure) < min(len(ring.coordinates), MOST_COORDINATES + 1) and closure not in closures:
                closures.add(closure)
                candidates += _casimirs_within(system, closure)
    for e in candidates:
        try:
            yield Term(e, ring.tower.convert(e))
        except ValueError:  # Casimirs with functions that H and π do not have are omitted
            continue


def _closure(ring: Ring, coordinates: set[int]) -> tuple[int, ...]:
    """Return the smallest set of coordinates that contains ``coordinates`` and is closed under brackets, as sorted
    indices."""
    while True:
        added = {k for i in coordinates for j in coordinates for k in ring.support(ring.poisson[i][j])}
        if added <= coordinates:
            return tuple(sorted(coordinates))
        coordinates = coordinates | added


def _casimirs_within(system: System, inside: Sequence[int]) -> list[Expression]:
    names = [system.coordinates[i] for i in inside]
    matrix = tuple(tuple(system.poisson[i][j] for j in inside) for i in inside)
    return list(polynomial_casimirs(names, matrix, General(), 2, []))


def by_blocks(system: System, ring: Ring, terms: Sequence[Term]) -> list[Term] | None:
    """Sum the terms of H that couple the same blocks of π, and return the resulting list of terms.

    A term couples blocks if it depends on coordinates of two or more blocks. Returns None if no terms are summed.
    """
    block_of = {i: k for k, block in enumerate(blocks(system.coordinates, system.poisson)) for i in block}
    groups: dict[tuple[int, ...], list[Term]] = {}
    for n, term in enumerate(terms):
        touched = tuple(sorted({block_of[i] for i in ring.support(term.element)}))
        groups.setdefault(touched if len(touched) > 1 else (-1, n), []).append(term)
    if len(groups) == len(terms):
        return None
    return [
        Term(total(t.expression for t in group), ring.tower.combine(t.element for t in group))
        for group in groups.values()
    ]
