"""The terms of H that a splitting distributes to parts: the summands as the user wrote them, or single monomials."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator

from phigen.geometry.system import System
from phigen.splitting.flow import Term
from phigen.splitting.ring import Ring
from phigen.symbolic.expression import ONE, Expression, neg, symbols_of, total
from phigen.symbolic.tower import Poly


def summands(e: Expression, coordinates: Collection[str], factor: Expression = ONE) -> Iterator[Expression]:
    """Yield the additive terms of an expression times ``factor``; constant factors of sums are multiplied into the
    terms."""
    if e.op in ("add", "sub"):
        yield from summands(e.args[0], coordinates, factor)
        yield from summands(e.args[1], coordinates, factor if e.op == "add" else neg(factor))
    elif e.op == "neg":
        yield from summands(e.args[0], coordinates, neg(factor))
    elif e.op == "mul" and any(_static(a, coordinates) for a in e.args):
        constant, cofactor = e.args if _static(e.args[0], coordinates) else e.args[::-1]
        yield from summands(cofactor, coordinates, constant * factor)
    else:
        yield factor * e


def _static(e: Expression, coordinates: Collection[str]) -> bool:
    return not any(s in coordinates for s in symbols_of(e))


def hamiltonian_terms(system: System) -> list[Expression]:
    """Return the additive terms of H, as the user wrote them."""
    return list(summands(system.hamiltonian, system.coordinates))


def terms_of(ring: Ring, listed: Iterable[Expression]) -> list[Term]:
    """Return the terms of H for a splitting, from a list of summands.

    A summand is one term if its coordinates commute; otherwise each of its monomials is a term. Terms that depend on
    the same set of coordinates are then summed.
    """
    terms: list[Term] = []
    for e in listed:
        element = ring.tower.convert(e)
        support = ring.support(element)
        if all((i, j) in ring.zero_pairs for i in support for j in support):
            terms.append(Term(e, element))
        else:
            terms += monomial_terms(ring, element)
    return joined(ring, terms)


def monomial_terms(ring: Ring, element: Poly) -> list[Term]:
    """Return the monomials of an element of the ring, each as a term."""
    parts = [c * ring.monomial(m) for m, c in ring.terms(element, ring.state).items()]
    return [Term(ring.expression(part), part) for part in parts if not ring.tower.is_zero(part)]


def joined(ring: Ring, terms: Iterable[Term]) -> list[Term]:
    """Sum all terms that depend on the same set of coordinates, and return the resulting list of terms.

    Constants are added to the first of the sums.
    """
    groups: dict[tuple[int, ...], list[Term]] = {}
    for term in terms:
        groups.setdefault(ring.support(term.element), []).append(term)
    constants = groups.pop((), [])
    if constants and groups:
        first = next(iter(groups))
        groups[first] += constants
    return [
        Term(total(t.expression for t in part), ring.tower.combine(t.element for t in part)) for part in groups.values()
    ]
