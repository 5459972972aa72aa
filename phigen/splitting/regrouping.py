"""Other ways to write H as a sum of terms, which may need fewer parts.

*Quadratic companions.* A Casimir C does not move anything, and |P|² on se(3)* commutes with every function of P. So
H = λC + (H − λC) may lose a term on the right that conflicts with others, at no cost: the free rigid body has two parts
rather than three. C is a Casimir of π, or of the bracket among some coordinates that is closed.

*Blocks.* Terms that couple the same blocks of π, such as products of the components of two spins, are taken together.
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

#: Most coordinates of a closed bracket whose Casimirs are looked for.
MOST_COORDINATES = 8


def with_companions(system: System, found: Conflicts, terms: Sequence[Term]) -> Iterator[list[Term]]:
    """The terms with λC taken out of them, for each companion C and each λ that makes a monomial disappear."""
    ring = found.ring
    for companion in _companions(system, found, terms):
        inside = ring.terms(companion.element, ring.state)
        affected = [t for t in terms if not found.monomials(t).isdisjoint(inside)]
        if not affected:
            continue
        others = [t for t in terms if t not in affected]
        sum_of_affected = ring.tower.combine(t.element for t in affected)
        present = ring.terms(sum_of_affected, ring.state)
        multiples: list[Poly] = []
        for monomial, coefficient in inside.items():
            inverse = ring.tower.inverse(coefficient) if monomial in present else None
            if inverse is not None:
                multiple = ring.tower.combine([present[monomial] * inverse])
                if multiple not in multiples:
                    multiples.append(multiple)
        for multiple in multiples:
            rest = ring.tower.combine([sum_of_affected, -multiple * companion.element])
            taken = Term(ring.expression(multiple) * companion.expression, multiple * companion.element)
            yield [*others, *joined(ring, monomial_terms(ring, rest)), taken]


def _companions(system: System, conflicts: Conflicts, terms: Sequence[Term]) -> Iterator[Term]:
    """Casimirs, and quadratic Casimirs of the closed brackets that pairs of conflicting terms generate."""
    ring, found = conflicts.ring, list(system.casimirs.values())
    seen: set[tuple[int, ...]] = set()
    for i, neighbours in enumerate(conflicts.graph(terms)):
        for j in sorted(n for n in neighbours if n < i):
            inside = _closure(ring, {*conflicts.support(terms[i]), *conflicts.support(terms[j])})
            if len(inside) < min(len(ring.coordinates), MOST_COORDINATES + 1) and inside not in seen:
                seen.add(inside)
                found += _casimirs_within(system, inside)
    for e in found:
        try:
            yield Term(e, ring.tower.convert(e))
        except ValueError:  # it needs functions that H and π do not have
            continue


def _closure(ring: Ring, coordinates: set[int]) -> tuple[int, ...]:
    """The coordinates that brackets of the given ones lead to."""
    while True:
        more = {k for i in coordinates for j in coordinates for k in ring.support(ring.poisson[i][j])}
        if more <= coordinates:
            return tuple(sorted(coordinates))
        coordinates = coordinates | more


def _casimirs_within(system: System, inside: Sequence[int]) -> list[Expression]:
    names = [system.coordinates[i] for i in inside]
    matrix = tuple(tuple(system.poisson[i][j] for j in inside) for i in inside)
    return list(polynomial_casimirs(names, matrix, General(), 2, []))


def by_blocks(system: System, ring: Ring, terms: Sequence[Term]) -> list[Term] | None:
    """Terms that touch the same two or more blocks of π taken together; None if that changes nothing."""
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
