"""Flows of damping at sites, as parts of the splitting of a lattice: ẋ = λππb with b = ∇H and the damping coefficient
λ.

The covector b depends on neighbours, which are damped too. Therefore b is written as a sum b₁ + b₂. For each summand,
the field λππb has a flow of its own.

b₁ has the terms that do not depend on the site itself. Its flow is elementary if the neighbours stand still. So sites
are coloured such that neighbours have different colours, and the flow is applied to one colour after the other.

b₂ has the terms that depend on fields of the site. Its flow is applied to all sites at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from phigen.errors import Diagnostic, SpecError
from phigen.lattice.cell import GRAPH, PAIRS, Cell
from phigen.lattice.graphs import site_sums, sums_by_field
from phigen.lattice.site_parts import (
    FORCE,
    BondSum,
    CellFlow,
    Colouring,
    SiteFields,
    SiteMotion,
    bracketless_ring,
    merged_colours,
)
from phigen.scheme.choosing import Host
from phigen.splitting.flow import solved
from phigen.symbolic.expression import ONE, ZERO, Expression, substitute, symbol, symbols_of, total
from phigen.symbolic.symbols import BEGINS, CHOSEN, Symbol

Covector = Mapping[str, Expression]

_HINT = (
    "damping of a spin has a flow if H is linear in the spin, or quadratic in one component of the spin; "
    "scheme: series works for every H"
)


def damping_flows(cell: Cell, colouring: Colouring, host: Host) -> tuple[CellFlow, ...]:
    """Return the flows of damping, ẋ = λππ∇H, for sites that are coloured by ``colouring``.

    Raises `SpecError` with the reason if there is no flow in closed form. If another colouring might have a flow, the
    error is a `TogetherError`.
    """
    try:
        return tuple(_flows(cell, colouring))
    except _NoFlowError as error:
        message = f"scheme splitting: the damping has no elementary flow on the lattice: {error}"
        kind = TogetherError if isinstance(error, _TogetherError) else SpecError
        raise kind([Diagnostic(message, host.locations.get(("damping",)), _HINT)]) from None


class TogetherError(SpecError):
    """Error for a colouring that gives neighbours one colour, so that they would be damped at the same time."""


class _NoFlowError(Exception):
    """The damping has no elementary flow; the text is the reason."""


class _TogetherError(_NoFlowError):
    """Two neighbours have the same colour. With another colouring, the damping may have an elementary flow."""


def _flows(cell: Cell, colouring: Colouring) -> Iterator[CellFlow]:
    if not cell.is_local or cell.relation == PAIRS:
        raise _NoFlowError("brackets couple sites" if not cell.is_local else "every site is a neighbour of all others")
    fixed_slopes, own_slopes = _slopes(cell)
    sums = _sums(cell)
    _flow(cell, fixed_slopes, [0], sums)  # raises _NoFlowError if no colouring has a flow
    for colour in _colours(cell, colouring, fixed_slopes):
        flow = _flow(cell, fixed_slopes, [colour], sums)
        if colouring.seams and colour is not None:
            seam_weight = symbol(Symbol(BEGINS, colour, *(0 for _ in cell.axes)))
            (seam_motion,) = _flow(cell, fixed_slopes, [None], sums, seam_weight).motions
            flow = replace(flow, beside=seam_motion)
        yield flow
    if any(not e.is_zero for e in own_slopes.values()):
        single = [{f: e if g == f else ZERO for f in cell.fields} for g, e in own_slopes.items() if not e.is_zero]
        colours: list[int | None] = [*range(colouring.count)]
        try:
            yield _flow(cell, own_slopes, colours)
        except _NoFlowError:
            yield from [_flow(cell, b, colours) for b in single]


def _slopes(cell: Cell) -> tuple[Covector, Covector]:
    """Return ∂H/∂f at a site for each field f, as two sums: terms without fields of the site itself, and all others."""
    site_fields = SiteFields(cell, sums_by_field(cell))
    slopes = [site_fields.slope(f) for f in cell.fields]
    ring = bracketless_ring(cell.fields, slopes)
    fixed_slopes, own_slopes = {}, {}
    for f, element in zip(cell.fields, ring.tower.convert_all(slopes), strict=True):
        parts = ring.terms(element, ring.state)
        fixed_slopes[f] = ring.expression(parts.pop((0,) * len(ring.tower.gens), ring.tower.zero))
        own_slopes[f] = total(ring.expression(c * ring.monomial(m)) for m, c in parts.items())
    return fixed_slopes, own_slopes


def _sums(cell: Cell) -> tuple[BondSum, ...]:
    """Return the sums over bonds that occur in ∇H at a damped site.

    Raises `_NoFlowError` if a sum contains fields of the damped site itself.
    """
    sums = site_sums(cell) if cell.relation == GRAPH else ()
    for base, offset in cell.places(*(e for s in sums for e in s.values.values())).values():
        if base in cell.fields and offset == ("a",):
            raise _NoFlowError(f"the damping along a bond depends on {base} of the damped site")
    return tuple(replace(s, chosen="here") for s in sums)


def _colours(cell: Cell, colouring: Colouring, fixed_slopes: Covector) -> list[int | None]:
    """Return the colours that are damped one after the other.

    There is one entry if the damping of a site does not depend on its neighbours. There is one entry for a graph as
    well, since its colours are known only at run time. Raises `_TogetherError` if two neighbours have the same colour.
    """
    if cell.relation == GRAPH:
        return [0]
    places = cell.places(*fixed_slopes.values(), *([cell.forces.damping] if cell.forces.damping is not None else []))
    neighbours = {offset for base, offset in places.values() if base in cell.fields and any(offset)}
    if not neighbours:
        return [None] if colouring.count > 1 else [0]
    if any(colouring.at(0, offset) == 0 for offset in neighbours):
        raise _TogetherError("neighbours have one colour, so that they would be damped at the same time")
    return [*range(colouring.count)]


def _flow(
    cell: Cell,
    covector: Covector,
    colours: list[int | None],
    sums: tuple[BondSum, ...] = (),
    weight: Expression = ONE,
) -> CellFlow:
    """Return the flow of damping ẋ = w λππb at the sites of ``colours``, with the damping coefficient λ.

    ``covector`` is b, which has some terms of ∇H, and ``weight`` is w. ``sums`` are the sums over bonds in b.
    """
    site_fields, n = SiteFields(cell), cell.fields
    fields_in_covector = {f for f, e in covector.items() if set(symbols_of(e)) & set(n)}
    b = {f: e if fields_in_covector or e.is_zero else symbol(Symbol(FORCE, f)) for f, e in covector.items()}
    factor = site_fields.damping() * (
        symbol(Symbol(CHOSEN)) if cell.relation == GRAPH and not fields_in_covector else weight
    )
    rates = {f: factor * site_fields.tangent(f, lambda g, _: site_fields.tangent(g, lambda h, _: b[h])) for f in n}
    ring = bracketless_ring(n, rates.values())
    solution = solved(ring, ring.tower.convert_all([rates[f] for f in n]))
    if isinstance(solution, str):
        raise _NoFlowError(solution)
    components: dict[str, Expression] = {} if fields_in_covector else {Symbol(FORCE, f): e for f, e in covector.items()}
    solution_increments = {f: e for f, e in zip(n, solution.increments, strict=True) if not e.is_zero}
    increments = dict(zip(solution_increments, substitute(list(solution_increments.values()), components), strict=True))
    bond_sums = () if fields_in_covector else sums
    motions = [
        SiteMotion(c, increments, bond_sums, rates, solution_increments, solution.manner, components)
        for c in colours
        if increments
    ]
    force = tuple(substitute(list(rates.values()), components))
    flow = CellFlow(
        ZERO, tuple(increments.values()), solution.manner, merged_colours(motions, len(colours)), force=force
    )
    return replace(flow, by_colour=cell.relation == GRAPH and not fields_in_covector and bool(bond_sums))
