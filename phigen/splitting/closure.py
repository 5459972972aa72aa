"""The linear equations that coordinates satisfy along the flow of a part, found by closing them under differentiation.

Starting from a coordinate, derivatives along π∇G are written as polynomials in the moving variables; each new monomial
joins the list. Where the list ends, its entries w obey ẇ = Aw, and A holds frozen and static quantities alone. So
kicks and drifts, rotations, shears and scalings are all one case, and triangular polynomial equations are another.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from phigen.splitting.ring import Monomial, Ring
from phigen.symbolic.tower import Poly

#: Longest list of monomials for one coordinate, and the largest degree of one; of coordinates alone, without products.
MOST_MONOMIALS, MOST_DEGREE, MOST_COORDINATES = 16, 8, 64

Row = dict[Monomial, Poly]


@dataclass(frozen=True)
class LinearMotion:
    """ẇ = Aw for the monomials w in ``basis``, of which the first are the ``coordinates`` (indices); A is constant.

    The monomial 1, if it is needed, is the last one.
    """

    coordinates: tuple[int, ...]
    basis: tuple[Monomial, ...]
    matrix: tuple[tuple[Poly, ...], ...]


@dataclass(frozen=True)
class Motion:
    """How the coordinates move: the ``moving`` variables, linear motions, and the rates of the other coordinates."""

    moving: frozenset[int]
    linear: tuple[LinearMotion, ...]
    other: Mapping[int, Poly]


def motion_of(ring: Ring, field: Sequence[Poly]) -> Motion:
    """The motion along a vector field, coordinate by coordinate."""
    rates = {v: ring.rate(ring.tower.gens[v], field) for v in ring.state}
    rates = {v: r for v, r in rates.items() if r != 0}
    rows: dict[Monomial, Row] = {}
    starts: dict[Monomial, int] = {}
    other: dict[int, Poly] = {}
    for i, c in enumerate(ring.coordinates):
        v = ring.tower.names.index(c)
        if v not in rates:
            continue
        start = tuple(int(k == v) for k in range(len(ring.tower.names)))
        found = _closed(ring, rates, start, rows)
        if found is None:
            other[i] = rates[v]
        else:
            rows |= found
            starts[start] = i
    return Motion(frozenset(rates), tuple(_motions(ring, rows, starts)), other)


def _closed(
    ring: Ring, rates: Mapping[int, Poly], start: Monomial, known: Mapping[Monomial, Row]
) -> dict[Monomial, Row] | None:
    """The rows of all monomials that the derivatives of one lead to; None if there seem to be infinitely many."""
    rows: dict[Monomial, Row] = {}
    pending = [start]
    while pending:
        m = pending.pop()
        if m in rows or m in known:
            continue
        most = MOST_COORDINATES if all(sum(k) <= 1 for k in (*rows, m)) else MOST_MONOMIALS
        if len(rows) >= most or sum(m) > MOST_DEGREE:
            return None
        rows[m] = _row(ring, rates, m)
        pending += sorted(rows[m])
    return rows


def _row(ring: Ring, rates: Mapping[int, Poly], m: Monomial) -> Row:
    """The derivative of a monomial."""
    parts = []
    for v, rate in rates.items():
        if m[v]:
            rest = ring.monomial((*m[:v], m[v] - 1, *m[v + 1 :]))
            parts.append(m[v] * rest * rate)
    found = ring.terms(ring.tower.combine(parts), rates)
    return {k: c for k, c in found.items() if not ring.tower.is_zero(c)}


def _motions(ring: Ring, rows: Mapping[Monomial, Row], starts: Mapping[Monomial, int]) -> Iterator[LinearMotion]:
    """The equations, cut into systems that do not share monomials other than 1."""
    label = {m: k for k, m in enumerate(rows) if any(m)}
    for m, row in rows.items():
        together = {label[k] for k in (m, *row) if any(k)}
        label = {k: min(together) if old in together else old for k, old in label.items()}
    for wanted in sorted(set(label.values())):
        inside = [m for m in rows if label.get(m) == wanted]
        basis = sorted((m for m in inside if m in starts), key=lambda m: starts[m])
        coordinates = tuple(starts[m] for m in basis)
        basis += [m for m in inside if m not in starts]
        basis += sorted({k for m in inside for k in rows[m] if not any(k)})
        zero = ring.tower.zero
        matrix = tuple(tuple(rows[m].get(k, zero) if any(m) else zero for k in basis) for m in basis)
        yield LinearMotion(coordinates, tuple(basis), matrix)
