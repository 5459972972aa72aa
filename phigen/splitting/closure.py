"""Linear equations for coordinates along the flow of a part G of H, found by repeated differentiation of monomials.

The derivative of a coordinate along the field π∇G is a polynomial in the variables that change along the flow. Each new
monomial in this polynomial is added to a list, and differentiated in turn. The search ends when no new monomials occur.
Then the monomials w in the list satisfy ẇ = Aw, where A contains only quantities that are constant along the flow.
Kicks, drifts, rotations, shears and scalings are special cases, as are triangular polynomial equations.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from phigen.splitting.ring import Monomial, Ring
from phigen.symbolic.tower import Poly

#: Bounds for a list of monomials w with ẇ = Aw. A monomial has at most the degree MOST_DEGREE. A list of single
#: coordinates has at most MOST_COORDINATES entries, any other list at most MOST_MONOMIALS. Lists beyond these bounds
#: are treated as infinite.
MOST_MONOMIALS, MOST_DEGREE, MOST_COORDINATES = 16, 8, 64

Row = dict[Monomial, Poly]


@dataclass(frozen=True)
class LinearMotion:
    """Linear equations ẇ = Aw for monomials w. The first monomials are single coordinates.

    ``basis`` has the exponents of all monomials, and ``coordinates`` the indices of the single coordinates. ``matrix``
    is A; its entries are constant along the flow. If the monomial 1 occurs, it is the last one.
    """

    coordinates: tuple[int, ...]
    basis: tuple[Monomial, ...]
    matrix: tuple[tuple[Poly, ...], ...]


@dataclass(frozen=True)
class Motion:
    """The motion along a vector field: linear differential equations for some coordinates, and time derivatives of the
    others.

    ``linear`` has the systems of linear equations. ``other`` maps the index of a coordinate without linear equations to
    its time derivative. ``moving`` has the indices of the variables of the ring that are not constant.
    """

    moving: frozenset[int]
    linear: tuple[LinearMotion, ...]
    other: Mapping[int, Poly]


def motion_of(ring: Ring, field: Sequence[Poly]) -> Motion:
    """Return the equations of motion along a vector field.

    Constant coordinates have no equations. For each other coordinate, phigen searches for linear differential
    equations. If the search fails, the result has the time derivative of this coordinate instead.
    """
    rates = {v: ring.rate(ring.tower.gens[v], field) for v in ring.state}
    rates = {v: r for v, r in rates.items() if r != 0}
    rows: dict[Monomial, Row] = {}
    starts: dict[Monomial, int] = {}
    nonlinear: dict[int, Poly] = {}
    for i, c in enumerate(ring.coordinates):
        v = ring.tower.names.index(c)
        if v not in rates:
            continue
        start = tuple(int(k == v) for k in range(len(ring.tower.names)))
        closed_rows = _closed(ring, rates, start, rows)
        if closed_rows is None:
            nonlinear[i] = rates[v]
        else:
            rows |= closed_rows
            starts[start] = i
    return Motion(frozenset(rates), tuple(_motions(ring, rows, starts)), nonlinear)


def _closed(
    ring: Ring, rates: Mapping[int, Poly], start: Monomial, known_rows: Mapping[Monomial, Row]
) -> dict[Monomial, Row] | None:
    """Return the derivatives of all monomials that occur in repeated derivatives of the monomial ``start``.

    ``known_rows`` are results of earlier calls; their monomials are left out. Returns None if the monomials exceed the
    bounds, and so may be infinitely many.
    """
    rows: dict[Monomial, Row] = {}
    pending = [start]
    while pending:
        m = pending.pop()
        if m in rows or m in known_rows:
            continue
        limit = MOST_COORDINATES if all(sum(k) <= 1 for k in (*rows, m)) else MOST_MONOMIALS
        if len(rows) >= limit or sum(m) > MOST_DEGREE:
            return None
        rows[m] = _row(ring, rates, m)
        pending += sorted(rows[m])
    return rows


def _row(ring: Ring, rates: Mapping[int, Poly], m: Monomial) -> Row:
    """Return the time derivative of the monomial ``m`` as a map: monomial → coefficient.

    ``rates`` has the time derivatives of the variables that change. Only these variables occur in the monomials.
    """
    parts = []
    for v, rate in rates.items():
        if m[v]:
            cofactor = ring.monomial((*m[:v], m[v] - 1, *m[v + 1 :]))
            parts.append(m[v] * cofactor * rate)
    terms = ring.terms(ring.tower.combine(parts), rates)
    return {k: c for k, c in terms.items() if not ring.tower.is_zero(c)}


def _motions(ring: Ring, rows: Mapping[Monomial, Row], starts: Mapping[Monomial, int]) -> Iterator[LinearMotion]:
    """Yield the linear equations as independent systems, which share no monomial other than 1."""
    label = {m: k for k, m in enumerate(rows) if any(m)}
    for m, row in rows.items():
        merged = {label[k] for k in (m, *row) if any(k)}
        label = {k: min(merged) if old_label in merged else old_label for k, old_label in label.items()}
    for label_of_system in sorted(set(label.values())):
        monomials = [m for m in rows if label.get(m) == label_of_system]
        basis = sorted((m for m in monomials if m in starts), key=lambda m: starts[m])
        coordinates = tuple(starts[m] for m in basis)
        basis += [m for m in monomials if m not in starts]
        basis += sorted({k for m in monomials for k in rows[m] if not any(k)})
        zero = ring.tower.zero
        matrix = tuple(tuple(rows[m].get(k, zero) if any(m) else zero for k in basis) for m in basis)
        yield LinearMotion(coordinates, tuple(basis), matrix)
