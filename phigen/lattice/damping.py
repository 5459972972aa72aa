"""Damping at sites as parts of a splitting: λππb with b = ∇H, which depends on neighbours that are damped too.

What of b at a site does not depend on the site has a flow while the neighbours stand still: sites of one colour are
damped at a time, so that no two neighbours are. The rest of b is that of the site alone, and has flows at all sites.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from phigen.errors import Diagnostic, SpecError
from phigen.lattice.cell import GRAPH, PAIRS, Cell
from phigen.lattice.graphs import site_sums, sums_by_field
from phigen.lattice.parts import FORCE, BondSum, CellFlow, Colouring, SiteFields, SiteMotion, at_every_site, own_ring
from phigen.scheme.choosing import Host
from phigen.splitting.flow import solved
from phigen.symbolic.expression import ONE, ZERO, Expression, substitute, symbol, symbols_of, total
from phigen.symbolic.symbols import BEGINS, CHOSEN, Symbol

Covector = Mapping[str, Expression]

_HINT = "that of a spin has one where H is linear or quadratic along an axis in it; scheme: series takes every H"


def damping_flows(cell: Cell, colouring: Colouring, host: Host) -> tuple[CellFlow, ...]:
    """The flows of damping. `SpecError` that says why there are none in closed form; `TogetherError` by the colours."""
    try:
        return tuple(_flows(cell, colouring))
    except _NoFlowError as error:
        message = f"scheme splitting: the damping has no elementary flow on the lattice: {error}"
        kind = TogetherError if isinstance(error, _TogetherError) else SpecError
        raise kind([Diagnostic(message, host.locations.get(("damping",)), _HINT)]) from None


class TogetherError(SpecError):
    """With these colours neighbours are damped together; with others they may not be."""


class _NoFlowError(Exception):
    """The text says what is in the way."""


class _TogetherError(_NoFlowError):
    """Colours are in the way."""


def _flows(cell: Cell, colouring: Colouring) -> Iterator[CellFlow]:
    if not cell.is_local or cell.relation == PAIRS:
        raise _NoFlowError("brackets couple sites" if not cell.is_local else "every site is a neighbour of all others")
    still, rest = _slopes(cell)
    sums = _sums(cell)
    _flow(cell, still, [0], sums)  # what has no flow has none by any colours
    for colour in _colours(cell, colouring, still):
        flow = _flow(cell, still, [colour], sums)
        if colouring.seams and colour is not None:
            there = symbol(Symbol(BEGINS, colour, *(0 for _ in cell.axes)))
            (beside,) = _flow(cell, still, [None], sums, there).motions
            flow = replace(flow, beside=beside)
        yield flow
    if any(not e.is_zero for e in rest.values()):
        single = [{f: e if g == f else ZERO for f in cell.fields} for g, e in rest.items() if not e.is_zero]
        colours: list[int | None] = [*range(colouring.count)]
        try:
            yield _flow(cell, rest, colours)
        except _NoFlowError:
            yield from [_flow(cell, b, colours) for b in single]


def _slopes(cell: Cell) -> tuple[Covector, Covector]:
    """∂H/∂f at a site: what does not depend on the site, and the rest."""
    at = SiteFields(cell, sums_by_field(cell))
    slopes = [at.slope(f) for f in cell.fields]
    ring = own_ring(cell.fields, slopes)
    still, rest = {}, {}
    for f, element in zip(cell.fields, ring.tower.convert_all(slopes), strict=True):
        parts = ring.terms(element, ring.state)
        still[f] = ring.expression(parts.pop((0,) * len(ring.tower.gens), ring.tower.zero))
        rest[f] = total(ring.expression(c * ring.monomial(m)) for m, c in parts.items())
    return still, rest


def _sums(cell: Cell) -> tuple[BondSum, ...]:
    """What bonds add to the slopes at sites of the colour, which does not depend on them."""
    sums = site_sums(cell) if cell.relation == GRAPH else ()
    for base, offset in cell.places(*(e for s in sums for e in s.values.values())).values():
        if base in cell.fields and offset == ("a",):
            raise _NoFlowError(f"what a bond adds depends on {base} of the site itself")
    return tuple(replace(s, chosen="here") for s in sums)


def _colours(cell: Cell, colouring: Colouring, still: Covector) -> list[int | None]:
    """The colours that are damped one after the other: one for all sites where these are independent."""
    if cell.relation == GRAPH:
        return [0]
    places = cell.places(*still.values(), *([cell.forces.damping] if cell.forces.damping is not None else []))
    reached = {offset for base, offset in places.values() if base in cell.fields and any(offset)}
    if not reached:
        return [None] if colouring.count > 1 else [0]
    if any(colouring.at(0, offset) == 0 for offset in reached):
        raise _TogetherError("neighbours are damped together, whatever the colours of sites")
    return [*range(colouring.count)]


def _flow(
    cell: Cell,
    covector: Covector,
    colours: list[int | None],
    sums: tuple[BondSum, ...] = (),
    there: Expression = ONE,
) -> CellFlow:
    """The flow of λππb for a covector b at sites of these colours, or where ``there`` is 1."""
    at, n = SiteFields(cell), cell.fields
    own = {f for f, e in covector.items() if set(symbols_of(e)) & set(n)}
    b = {f: e if own or e.is_zero else symbol(Symbol(FORCE, f)) for f, e in covector.items()}
    factor = at.damping() * (symbol(Symbol(CHOSEN)) if cell.relation == GRAPH and not own else there)
    rates = {f: factor * at.tangent(f, lambda g, _: at.tangent(g, lambda h, _: b[h])) for f in n}
    ring = own_ring(n, rates.values())
    found = solved(ring, ring.tower.convert_all([rates[f] for f in n]))
    if isinstance(found, str):
        raise _NoFlowError(found)
    components: dict[str, Expression] = {} if own else {Symbol(FORCE, f): e for f, e in covector.items()}
    moved = {f: e for f, e in zip(n, found.increments, strict=True) if not e.is_zero}
    increments = dict(zip(moved, substitute(list(moved.values()), components), strict=True))
    gathered = () if own else sums
    motions = [
        SiteMotion(c, increments, gathered, rates, moved, found.manner, components) for c in colours if increments
    ]
    force = tuple(substitute(list(rates.values()), components))
    flow = CellFlow(ZERO, tuple(increments.values()), found.manner, at_every_site(motions, len(colours)), force=force)
    return replace(flow, by_colour=cell.relation == GRAPH and not own and bool(gathered))
