"""Lowering to row functions: sweeps, stages, observables, and sums over bonds or pairs.

A row function runs over the sites of a row segment; see `phigen.ir.passes.by_rows`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from phigen.ir import nodes as ir
from phigen.ir.passes.by_rows import (
    AT_BONDS,
    BOND,
    FROM,
    LENGTH,
    OTHER,
    ROW,
    SIDE,
    SITE,
    SOLVER,
    WRITTEN,
    Reading,
    RowDeclarations,
    RowLayout,
    gathered,
    grouped,
    over_sites,
    rows_of,
    together,
)  # fmt: skip
from phigen.ir.passes.function_parameters import discard_unread
from phigen.ir.passes.sums import compensated_sum, limit, updates
from phigen.ir.walk import names_in
from phigen.scheme.kernel import Role
from phigen.symbolic.expression import ZERO as NOTHING
from phigen.symbolic.expression import Expression
from phigen.symbolic.symbols import Symbol

OUT = ir.fixed("out")
OTHER_SITE = ir.Entry(ir.Member(SOLVER, "other"), BOND)
ZERO, ONE = ir.Constant(0.0), ir.Constant(1.0)
#: Distance in memory between successive values of one site, in arrays that callers pass.
SITES: ir.Value = ir.Cast(ir.Member(SOLVER, "sites"))


def sweep(function: ir.Function, layout: RowLayout, *, passed: bool = False, compensated: bool = False) -> ir.Function:
    """Return the function of a sweep over the sites of a row segment.

    The colour that the sweep updates is a constant in the code or, with ``passed``, a member of the row record. If
    ``compensated``, fields are updated by compensated sums.
    """
    stores = function.loop.stores
    if function.role is Role.SWEEP_TANGENT:
        names = {s.array.number: Symbol("out", s.array.name) for s in sorted(stores, key=lambda s: s.array.name)}
        return _storing(function, layout, names, "varied", ir.Pointer(constant=False), adds=True)
    rows = rows_of(function, layout, Reading(frozenset(s.array.name for s in stores)))
    head, body = list[ir.Statement](), [*rows.at_site(), *rows.computed]
    for k, s in enumerate(stores):
        field = ir.Entry(rows.pointer(s.array.name), SITE)
        if compensated:
            compensation = ir.Name(Symbol("carry", s.array.name))
            compensation_row = layout.row(ir.entry(ir.Member(SOLVER, "carry"), s.array.number))
            head.append(ir.Declare(ir.Pointer(constant=False), ((compensation.symbol, compensation_row),)))
            body += compensated_sum(k, field, ir.Entry(compensation, SITE), s.value)
        elif s.array.name in rows.loaded:
            body.append(ir.Assign(field, ir.Accumulated(ir.Name(s.array.name), s.value)))
        else:
            body.append(ir.Assign(field, s.value, adds=True))
    selection = function.loop.selection
    colour, low = selection.colour, _from(selection)
    swept = ir.Member(ROW, "swept") if passed else ir.Constant(colour)
    swept_sites = of_colour(body, colour, swept, layout, low)
    return row_function(function, "coef", "row", body=(*head, *rows.before(), swept_sites))


def _from(selection: ir.Selection) -> ir.Value:
    """Return the first site that a sweep updates in a row segment."""
    if not selection.first:
        return FROM
    return ir.Select(ir.Binary("<", FROM, ir.Constant(selection.first)), ir.Constant(selection.first), FROM)


def of_colour(
    body: Iterable[ir.Statement],
    colour: int | None,
    swept: ir.Value,
    layout: RowLayout,
    low: ir.Value = FROM,
    **more: Any,
) -> ir.Loop:
    """Return the loop over the sites from ``low`` on. Unless ``colour`` is None, the loop runs only over sites of one
    colour, which the generated code computes as ``swept``.
    """
    if colour is None:
        return over_sites(body, low=low, **more)
    first = ir.Called("first", (ROW, swept, low))
    return over_sites(body, low=first, step=ir.Constant(layout.colour_step), **more)


def row_function(function: ir.Function, *parameters: str, body: Iterable[ir.Statement]) -> ir.Function:
    """Return the function with the given parameters and body. Parameters that are never read are marked as unused."""
    return discard_unread(replace(function, parameters=parameters, body=tuple(body)))


def stage(function: ir.Function, layout: RowLayout, outputs: Sequence[Symbol], *, adds: bool) -> ir.Function:
    """Return the row function that evaluates a kernel of a stage. If ``adds``, the function adds the outputs of the
    kernel to the arrays of results. Otherwise it assigns the outputs.
    """
    return _storing(function, layout, dict(enumerate(outputs)), "out", WRITTEN, adds=adds)


def _storing(
    function: ir.Function, layout: RowLayout, names: Mapping[int, str], member: str, kind: ir.Pointer, *, adds: bool
) -> ir.Function:
    """Return a row function that stores its results in arrays. The row record has pointers to these arrays, in a list
    whose name is ``member``.

    ``names`` maps the number of each array to the name of a local pointer to this array.
    """
    rows, selection = rows_of(function, layout), function.loop.selection
    head = grouped({name: (kind, layout.row(ir.entry(ir.Member(ROW, member), k))) for k, name in names.items()})
    places = ((ir.Entry(ir.Name(names[s.array.number]), SITE), s.value) for s in function.loop.stores)
    body = (*rows.at_site(), *rows.computed, *(ir.Assign(place, value, adds) for place, value in places))
    loop = of_colour(body, selection.colour, ir.Constant(selection.colour), layout, _from(selection))
    return row_function(function, "coef", "row", body=(*head, *rows.before(), loop))


@dataclass(frozen=True)
class BondLoop:
    """A function that sums over the bonds or pairs of a site, and the names of additional arguments of its row
    function.

    ``oriented`` lists parameters at bonds. The sign of these parameters changes if the site of the loop is the end b of
    the bond. The field ``arguments`` may contain three names. ``at_bonds`` is the array of parameters at bonds.
    ``sign`` is the direction of a bond at the site where the bond begins, 1 or −1. ``across`` says which site of a bond
    must have the colour of the sweep: the other site if ``across`` is 1, the site of the loop if ``across`` is 0. The
    function omits all other bonds.
    """

    function: ir.Function
    oriented: frozenset[str] = frozenset()
    arguments: tuple[str, ...] = ()

    @property
    def at_bonds(self) -> ir.Value:
        """The array of parameters at bonds."""
        return ir.fixed("at_bonds") if "at_bonds" in self.arguments else AT_BONDS

    @property
    def across(self) -> bool:
        """Whether the function has the parameter ``across``."""
        return "across" in self.arguments

    @property
    def parameters(self) -> tuple[str, ...]:
        """The parameters of the row function."""
        return (*[p for p in self.function.parameters if p == "coef"], "row", *self.arguments)


def observable(function: ir.Function, layout: RowLayout, calls: Sequence[str], apart: ir.Value = SITES) -> ir.Function:
    """Return the row function of a density, an energy or the vector field. It first calls the functions ``calls``,
    which compute sums over bonds or pairs.

    ``apart`` is the distance in memory between successive values of one site in the output.
    """
    rows, stores = rows_of(function, layout), function.loop.stores
    body = (*rows.at_site(), *rows.computed, *_observed(stores))
    head = (*(ir.Call(name, (ROW,)) for name in calls), *_apart(stores, apart), *rows.before())
    return row_function(function, "row", "out", body=(*head, over_sites(body)))


def observable_with_bonds(
    function: ir.Function, layout: RowLayout, sums: Sequence[BondLoop], apart: ir.Value = SITES
) -> ir.Function:
    """Return the function that evaluates an observable row by row. For each site, inner loops sum over the bonds of the
    site.
    """
    loop, observed = function.loop, function.loop.stores
    oriented = frozenset[str]().union(*(s.oriented for s in sums))
    outer = [*function.body, *(s for bond_loop in sums for s in bond_loop.function.body)]
    order = [*layout.members]
    once = sorted(
        (s for s in outer if isinstance(s, ir.Declare)),
        key=lambda s: order.index(s.items[0][1].name) if isinstance(s.items[0][1], ir.SystemParameter) else len(order),
    )
    rows = RowDeclarations(layout, Reading(local=True, oriented=oriented)).read(dict.fromkeys(once)).read(loop.body)
    computed, bond_loops = rows.computed, []
    rows.read(
        sorted((s for bond_loop in sums for s in bond_loop.function.loop.body if not _is_computed(s)), key=_at_bond)
    )
    for bond_loop in sums:
        rows.computed = [s for s in bond_loop.function.loop.body if _is_computed(s)]
        bond_loops.append(_summed_over_bonds(bond_loop, rows))
    stores = [s for bond_loop in sums for s in bond_loop.function.loop.stores]
    body = (*rows.at_site(), _begun(stores), *bond_loops, *computed, *_observed(observed))
    return row_function(function, "row", "out", body=(*_apart(observed, apart), *rows.before(), over_sites(body, "")))


def _is_computed(s: ir.Statement) -> bool:
    return isinstance(s, ir.Declare) and isinstance(s.items[0][1], Expression)


def _at_bond(s: ir.Statement) -> bool:
    return isinstance(s, ir.Declare) and isinstance(s.items[0][1], ir.BondParameter)


def _apart(stores: Sequence[ir.Store], apart: ir.Value) -> list[ir.Statement]:
    """Return the declaration of the distance in memory between values of one site, if an observable has several
    values.
    """
    return [ir.index(ir.fixed("apart"), apart)] * any(s.array.number for s in stores)


def _observed(stores: Sequence[ir.Store]) -> Iterator[ir.Statement]:
    """Yield the statements that store the values of an observable in the array of the caller. A store with the flag
    ``adds`` does not become a statement: its value is added to the value of each of the other stores.
    """
    shares, apart = [s.value for s in stores if s.adds], ir.fixed("apart")
    for s in stores:
        if not s.adds:
            k = s.array.number
            first = apart if k == 1 else ir.Binary("*", ir.Constant(k), apart)
            place = ir.Binary("+", first, SITE) if k else SITE
            terms = [*([s.value] if s.value is not NOTHING or not shares else []), *shares]
            yield ir.Assign(ir.Entry(OUT, ir.Binary("-", place, FROM)), ir.joined("+", *terms))


def over_bonds(bond_loop: BondLoop, layout: RowLayout, *, first: bool) -> ir.Function:
    """Return the row function that sums over the bonds of each site.

    If ``first``, the function assigns the sums. Otherwise it adds to the sums that an earlier function has computed.
    """
    reading = Reading(oriented=bond_loop.oriented, at_bonds=bond_loop.at_bonds)
    rows, count = rows_of(bond_loop.function, layout, reading), len(bond_loop.function.loop.stores)
    sums = (ir.Entry(gathered(k), SITE) for k in range(count))
    stores = [ir.Assign(place, ir.fixed(f"sum{k}"), adds=not first) for k, place in enumerate(sums)]
    body = (*together(rows.here), _begun(bond_loop.function.loop.stores), _summed_over_bonds(bond_loop, rows), *stores)
    return row_function(bond_loop.function, *bond_loop.parameters, body=(*rows.before(), over_sites(body, "")))


def _begun(stores: Sequence[ir.Store]) -> ir.Declare:
    """Return the declaration of the sums with initial value 0, and of maxima and minima with initial value −∞ or ∞."""
    starts = {s.array.number: _start(s) for s in stores}
    items = tuple((ir.fixed(f"sum{k}").symbol, starts.get(k, ZERO)) for k in range(max(starts, default=0) + 1))
    return ir.Declare(ir.Type.REAL, items, mutable=True)


def _start(s: ir.Store) -> ir.Value:
    return limit(s.extreme, "HUGE_VAL") if s.extreme else ZERO


def _summed_over_bonds(bond_loop: BondLoop, rows: RowDeclarations) -> ir.Loop:
    """Return the loop that adds up the contributions of the bonds of one site."""
    sign = ir.fixed("sign") if "sign" in bond_loop.arguments else ONE
    updated = (u for s in bond_loop.function.loop.stores for u in updates(s, ir.fixed(f"sum{s.array.number}"), s.value))
    return bonds_of(bond_loop.function.loop, rows, updated, sign, across=bond_loop.across)


def bonds_of(
    loop: ir.Loop, rows: RowDeclarations, updated: Iterable[ir.Statement], sign: ir.Value, *, across: bool = False
) -> ir.Loop:
    """Return the loop over the bonds of a site. ``loop.end`` selects the bonds that begin at the site ("a"), the bonds
    that end at the site ("b"), or all bonds of the site ("").

    ``loop.chosen`` may name one of the two sites of a bond: ``here`` (the site of the loop) or ``there`` (the other
    site). Then the loop skips all bonds at which this site does not have the colour of the sweep. If ``across`` is
    true, ``loop.chosen`` is not used; a flag of the generated code selects the site instead. The variable `SIDE` is the
    direction of the bond: ``sign`` at the site where the bond begins, −``sign`` at the site where it ends.
    """
    names = [s.items[0][0] for s in loop.body if isinstance(s, ir.Declare)]
    reads_there = [(name, value) for name, value in rows.other.items() if name in names]
    read = names_in((*(value for _, value in reads_there), tuple(updated := [*updated])))
    body = list[ir.Statement]()
    if across or loop.chosen == "there":
        coloured_site = ir.Select(ir.fixed("across"), OTHER_SITE, SITE) if across else OTHER_SITE
        colour = ir.Entry(ir.Member(SOLVER, "colours"), coloured_site)
        body.append(ir.If(ir.Binary("!=", colour, ir.Member(ROW, "chosen")), (ir.Continue(),)))
    body += [ir.index(OTHER, OTHER_SITE)] * (OTHER.symbol in read)
    first, middle = (ir.Entry(ir.Member(SOLVER, name), SITE) for name in ("bonds", "middle"))
    minus = ir.Constant(-sign.value) if isinstance(sign, ir.Constant) else ir.Prefix("-", sign)  # type: ignore[operator]
    direction = ir.Select(ir.Binary("<", BOND, middle), sign, minus)
    body += [ir.real(SIDE, direction)] * (SIDE.symbol in read)
    body += [*together(reads_there), *rows.computed, *updated]
    end = ir.Entry(ir.Member(SOLVER, "bonds"), ir.plus(SITE, 1))
    low, high = {"": (first, end), "a": (first, middle), "b": (middle, end)}[loop.end]
    at_colour = ir.Binary("==", ir.Entry(ir.Member(SOLVER, "colours"), SITE), ir.Member(ROW, "chosen"))
    condition = at_colour if loop.chosen == "here" and not across else None
    return ir.Loop("plain", tuple(body), "k", low, high, condition=condition)


def over_pairs(bond_loop: BondLoop, layout: RowLayout) -> ir.Function:
    """Return the row function that computes, for each site of a row segment, sums over all other sites."""
    rows = rows_of(bond_loop.function, layout)
    sums = [ir.fixed(f"g{s.array.number}") for s in bond_loop.function.loop.stores]
    arrays = {g.symbol: (WRITTEN, gathered(k)) for k, g in enumerate(sums)}
    places = [ir.Entry(g, SITE) for g in sums]
    starts = [_start(s) for s in bond_loop.function.loop.stores]
    alike = {start: [p for p, other in zip(places, starts, strict=True) if other == start] for start in starts}
    clear = [
        over_sites((ir.Assign(alike[start][0], start, too=tuple(alike[start][1:])),), "", kind="line")
        for start in alike
    ]
    same = ir.Binary("==", SITE, OTHER)
    values = [ir.Select(same, start, s.value) for start, s in zip(starts, bond_loop.function.loop.stores, strict=True)]
    updated = (
        u for s, p, v in zip(bond_loop.function.loop.stores, places, values, strict=True) for u in updates(s, p, v)
    )
    inner = over_sites((*together(rows.here), *rows.computed, *updated))
    selection = bond_loop.function.loop.selection
    high = ir.Member(SOLVER, "massive") if selection.massive else LENGTH
    outer = ir.Loop("plain", (*together(rows.other.items()), inner), "j", ir.Constant(selection.first), high)
    return row_function(
        bond_loop.function, *bond_loop.parameters, body=(*rows.before(), *grouped(arrays), *clear, outer)
    )
