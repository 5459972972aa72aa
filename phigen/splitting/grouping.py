"""Sums of terms of H whose joint flow is simpler than the flows of the single terms, such as rotations about a vector.

*Cancelling terms.* For m·N on se(3)*, each term m_i N_i changes m and N by products of m and N. The sum of the three
terms changes neither m nor N, and rotates other vectors about N. Terms are summed if monomials of their vector fields
cancel.

*Linear terms.* In Σ v_i m_i let all v_i commute with each other and with all m_i. Then the v_i are constant along the
flow, and the m_i satisfy linear equations: the flow is a rotation about the vector v, a shear, or another linear action
of the algebra.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import Any

from phigen.splitting.flow import EXPONENTIALS, Flow, Term, joint_flow
from phigen.splitting.ring import Monomial, Ring
from phigen.splitting.terms import monomial_terms
from phigen.symbolic.expression import total
from phigen.symbolic.tower import Poly

#: Place of a coefficient in a vector field: index of the coordinate, and exponents of the monomial in its rate.
_Place = tuple[int, Monomial]


def groupings(ring: Ring, terms: Sequence[Term]) -> Iterator[list[Term]]:
    """Yield lists of terms in which some terms are replaced by their sum.

    In the first list, terms are summed if monomials of their vector fields cancel in the sum. In the second list, the
    linear terms are summed (`_is_linear`). In the third list, both are done. Lists that change nothing are left out.
    Nothing is yielded if π is constant.
    """
    if not _algebra(ring):
        return
    cancelling = _with_cancelling(ring, terms)
    for candidate in (cancelling, _with_linear(ring, terms), cancelling and _with_linear(ring, cancelling)):
        if candidate:
            yield candidate


def _with_cancelling(ring: Ring, terms: Sequence[Term]) -> list[Term] | None:
    """Sum terms whose vector fields have monomials that cancel each other, and return the resulting list of
    terms.

    Returns None if no monomials cancel, or if phigen finds no flow for any of the sums.
    """
    fields = [_field_monomials(ring, t) for t in terms]
    users: dict[_Place, list[int]] = {}
    for k, field in enumerate(fields):
        for monomial in field:
            users.setdefault(monomial, []).append(k)
    label = list(range(len(terms)))
    for monomial, sharing in users.items():
        for n, a in enumerate(sharing):
            for b in sharing[:n]:
                if label[a] != label[b] and fields[a][monomial] + fields[b][monomial] == 0:
                    label = [label[b] if old_label == label[a] else old_label for old_label in label]
    classes = [
        [t for t, k in zip(terms, label, strict=True) if k == class_label] for class_label in dict.fromkeys(label)
    ]
    sums = [t for group in classes for t in (_sum_with_flow(ring, group) or group)]
    return sums if len(sums) < len(terms) else None


def _sum_with_flow(ring: Ring, group: Sequence[Term]) -> list[Term] | None:
    """Return a list that contains only the sum of the terms ``group``. Returns None if ``group`` is a single term, or
    if phigen knows no flow of the sum.
    """
    if len(group) == 1:
        return None
    sum_of_terms = Term(total(t.expression for t in group), ring.tower.combine(t.element for t in group))
    return [sum_of_terms] if isinstance(joint_flow(ring, [sum_of_terms], methods=EXPONENTIALS), Flow) else None


def _field_monomials(ring: Ring, term: Term) -> dict[_Place, Any]:
    """Return the coefficients of the vector field π∇G of a term G, by coordinate and monomial."""
    return {
        (i, tuple(map(int, m))): c
        for i, rate in enumerate(ring.field(term.element))
        if rate != 0
        for m, c in rate.to_dict().items()
    }


def _with_linear(ring: Ring, terms: Sequence[Term]) -> list[Term] | None:
    """Sum all linear terms, and return the resulting list of terms.

    A linear term is a coordinate of a Lie algebra times factors that are constant along its flow (`_is_linear`).
    Returns None if all linear terms commute with each other, or if their sum has no flow.
    """
    algebra = _algebra(ring)
    linear: list[Term] = []
    other_terms: list[Term] = []
    for term in terms:
        monomials = monomial_terms(ring, term.element)
        linear_pieces = [p for p in monomials if _is_linear(ring, p.element, algebra)]
        linear += linear_pieces
        if len(linear_pieces) < len(monomials):
            remainder = ring.tower.combine([term.element, *(-p.element for p in linear_pieces)])
            other_terms.append(Term(ring.expression(remainder), remainder) if linear_pieces else term)
    if all(ring.commute(a.element, b.element) for n, a in enumerate(linear) for b in linear[:n]):
        return None
    sum_of_linear = _sum_with_flow(ring, linear)
    return [*other_terms, *sum_of_linear] if sum_of_linear else None


def _algebra(ring: Ring) -> frozenset[int]:
    """Return the indices of the coordinates that have at least one non-constant bracket."""
    n = range(len(ring.coordinates))
    return frozenset(i for i in n if any(ring.support(ring.poisson[i][j]) for j in ring.brackets_of[i]))


def _is_linear(ring: Ring, element: Poly, algebra: Collection[int]) -> bool:
    """Whether a monomial is one coordinate of the algebra times factors that commute with each other and with the
    algebra."""
    names = [ring.coordinates[i] for i in algebra]
    ((monomial, _),) = ring.terms(element, ring.state).items()
    reading = [
        (v, exponent)
        for v, exponent in enumerate(monomial)
        if exponent and ring.tower.depends_on(ring.tower.gens[v], names)
    ]
    if [exponent for _, exponent in reading] != [1] or ring.tower.names[reading[0][0]] not in names:
        return False
    factors = [i for i in ring.support(element) if i not in algebra]
    return all((i, j) in ring.zero_pairs for i in factors for j in (*factors, *algebra))
