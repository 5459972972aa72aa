"""Linear equations of coordinates along the flow of a part, by closing sets of monomials under differentiation.

The derivative of a coordinate along π∇G is a polynomial in the moving variables, and each new monomial of it joins a
list. If the list is finite, its entries w satisfy ẇ = Aw, where A contains only frozen and static quantities. Kicks and
drifts, rotations, shears and scalings are special cases, as are triangular polynomial equations.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from phigen.splitting.ring import Monomial, Ring
from phigen.symbolic.tower import Poly

#: Bounds of a list: number of monomials, their degree, and number of coordinates in a list without products. Longer
#: lists are treated as infinite.
MOST_MONOMIALS, MOST_DEGREE, MOST_COORDINATES = 16, 8, 64

Row = dict[Monomial, Poly]


@dataclass(frozen=True)
class LinearMotion:
    """Linear equations ẇ = Aw for the monomials w in ``basis``; the first of them are the ``coordinates`` (indices).

    A, the ``matrix``, is constant. If the equations need the monomial 1, it is the last one.
    """

    coordinates: tuple[int, ...]
    basis: tuple[Monomial, ...]
    matrix: tuple[tuple[Poly, ...], ...]


@dataclass(frozen=True)
class Motion:
    """The motion of the coordinates: linear equations for some, and the rates of the ``other`` coordinates by index.

    ``moving`` are the variables that are not constant.
    """

    moving: frozenset[int]
    linear: tuple[LinearMotion, ...]
    other: Mapping[int, Poly]


def motion_of(ring: Ring, field: Sequence[Poly]) -> Motion:
    """Return the motion along a vector field."""
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
    """Return the rows of all monomials in the repeated derivatives of ``start``; None if there seem to be infinitely
    many.
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
    """Return the derivative of a monomial, by monomials."""
    parts = []
    for v, rate in rates.items():
        if m[v]:
            cofactor = ring.monomial((*m[:v], m[v] - 1, *m[v + 1 :]))
            parts.append(m[v] * cofactor * rate)
    terms = ring.terms(ring.tower.combine(parts), rates)
    return {k: c for k, c in terms.items() if not ring.tower.is_zero(c)}


def _motions(ring: Ring, rows: Mapping[Monomial, Row], starts: Mapping[Monomial, int]) -> Iterator[LinearMotion]:
    """Yield the linear equations, divided into systems that share no monomials other than 1."""
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
