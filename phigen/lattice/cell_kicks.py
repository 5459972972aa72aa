"""Search for the parts V of H = T + V on a lattice that can be the potential of a Nyström method.

On grids, the flow of the modified potential V + κ{V, {V, T}} with a number κ is computed too; see
`phigen.splitting.kicks`. The bracket {F, G} of two sums F and G over sites is again a sum over sites s. A field f at
the site s and a field g at the site s + d contribute the term ∂F/∂f(s) {f, g}(s) ∂G/∂g(s + d) if their bracket {f,
g}(s) is not 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from phigen.lattice.cell import GRID, Cell
from phigen.lattice.site_parts import CellFlow, CellSplitting, PartSearch, Summand
from phigen.splitting.kicks import MOST_MONOMIALS, Kick, degree
from phigen.splitting.ring import Ring
from phigen.symbolic.expression import Expression, gradient, symbols_of
from phigen.symbolic.neighbours import minus
from phigen.symbolic.tower import Tower


def cell_kicks(cell: Cell, splitting: CellSplitting) -> tuple[Kick, ...]:
    """Return the parts V of H = T + V that can be the potential of a Nyström method.

    The method requires {V, {V, {V, T}}} = 0, which is proved by polynomial degrees. There is no result if the splitting
    does not have exactly two parts, or if it has colours. On a grid, each result also has the flow of the modified
    potential V + κ{V, {V, T}}.
    """
    coloured = splitting.colouring.count > 1 or any(flow.by_colour for flow in splitting.flows)
    if len(splitting.flows) != 2 or coloured or cell.bond_bracket:
        return ()
    kicks = []
    for part in (0, 1):
        v, t = splitting.flows[part], splitting.flows[1 - part]
        if _graded(cell, v, t):
            kicks.append(Kick(part, _modified(cell, splitting, v, t) if cell.relation == GRID else None))
    return tuple(kicks)


def _graded(cell: Cell, v: CellFlow, t: CellFlow) -> bool:
    """Whether {V, {V, {V, T}}} = 0 follows from the polynomial degrees of T and of the brackets.

    V and T are the parts of H with the flows ``v`` and ``t``.
    """
    potential_fields = {f for s, _ in v.summands for f in _fields(cell, s.expression)}
    while True:
        entries = [e for (f, _), e in cell.bracket.items() if f in potential_fields]
        bracket_fields = {f for e in entries for f in _fields(cell, e)} - potential_fields
        if not bracket_fields:
            break
        potential_fields |= bracket_fields
    other_fields = set(cell.fields) - potential_fields
    pairs = [(f, cell.place(g)[0], e) for (f, g), e in cell.bracket.items()]
    return (
        not any(f in potential_fields and g in potential_fields for f, g, _ in pairs)
        and all(_degree(cell, e, other_fields) <= 1 for f, g, e in pairs if f in other_fields and g in other_fields)
        and all(_degree(cell, s.expression, other_fields) <= 2 for s, _ in t.summands)
    )


def _fields(cell: Cell, e: Expression) -> set[str]:
    return {f for f, _ in cell.places(e).values() if f in cell.fields}


def _degree(cell: Cell, e: Expression, fields: set[str]) -> float:
    names = [n for n, (f, _) in cell.places(e).items() if f in cell.fields]
    parameters = [n for n in symbols_of(e) if n not in names]
    ring = Ring(Tower([*names, *parameters], [e], names), tuple(names), (), ())
    field_indices = [i for i, n in enumerate(names) if cell.place(n)[0] in fields]
    return degree(ring, ring.tower.convert(e), field_indices)


def _modified(cell: Cell, splitting: CellSplitting, v: CellFlow, t: CellFlow) -> CellFlow | None:
    """Return the flow of V + κ{V, {V, T}}, the modified potential of a Nyström method, for parts V and T of H.

    Returns None if {V, {V, T}} is 0, or if it has too many terms.
    """
    potential, kinetic = ([s for s, _ in flow.summands] for flow in (v, t))
    twice = list(_bracket(cell, potential, list(_bracket(cell, potential, kinetic))))
    if not twice or len(twice) > MOST_MONOMIALS:
        return None
    search = PartSearch(cell, splitting.colouring)
    return search.flow([(s, 0) for s in potential], [(s, 0) for s in twice])


def _bracket(cell: Cell, left: Sequence[Summand], right: Sequence[Summand]) -> Iterator[Summand]:
    """Yield the terms of the bracket {Σ left, Σ right} of two sums over sites."""
    slopes = {f: list(_slopes(cell, left, f)) for f in cell.fields}
    right_slopes = {f: list(_slopes(cell, right, f)) for f in cell.fields}
    for (f, other), entry in cell.bracket.items():
        g, d = cell.place(other)
        steps = tuple(int(o) for o in d)
        for a in slopes[f]:
            for b in right_slopes[g]:
                low = tuple(min(0, x, s, y + s) for x, y, s in zip(a.low, b.low, steps, strict=True))
                high = tuple(max(0, x, s, y + s) for x, y, s in zip(a.high, b.high, steps, strict=True))
                yield Summand(a.expression * entry * cell.shifted(b.expression, d), low, high)


def _slopes(cell: Cell, summands: Sequence[Summand], field: str) -> Iterator[Summand]:
    """Yield the terms of the derivative of a sum over sites with respect to a field at one site."""
    for s in summands:
        places = {n: o for n, (f, o) in cell.places(s.expression).items() if f == field}
        for slope, offset in zip(gradient(s.expression, list(places)), places.values(), strict=True):
            if not slope.is_zero:
                opposite_offset = [-int(o) for o in offset]
                low = tuple(x + b for x, b in zip(s.low, opposite_offset, strict=True))
                high = tuple(x + b for x, b in zip(s.high, opposite_offset, strict=True))
                yield Summand(cell.shifted(slope, minus(offset)), low, high)
