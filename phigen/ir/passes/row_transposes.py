"""Lowering of transposed functions to functions that run over row segments. A site writes only its own elements, so
that threads have no write conflicts.

A site adds to its own cotangents directly. Its contributions to the cotangents of other sites are stored in arrays, one
array for each kind of contribution. In a second loop, each site adds the contributions that its neighbours have stored
for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from phigen.ir import nodes as ir
from phigen.ir.nodes import Storage
from phigen.ir.passes.by_rows import (
    BOND,
    FROM,
    LENGTH,
    OTHER,
    READ,
    ROW,
    SIDE,
    SITE,
    TO,
    WRITTEN,
    Reading,
    RowDeclarations,
    RowLayout,
    gathered,
    over_sites,
    rows_of,
    together,
)  # fmt: skip
from phigen.ir.passes.row_loops import ONE, ZERO, bonds_of, of_colour, row_function
from phigen.scheme.kernel import Role
from phigen.symbolic.symbols import HERE

BEGIN, END, APART, WHOLE, LANES, LANE, INDEX_TO = (
    ir.fixed(name) for name in ("begin", "end", "apart", "whole", "lanes", "l", "to")
)
#: BATCH is the number of partial sums for each sum over sites; it is a macro of the generated C. SUMS is the array of
#: the partial sums, which the runtime adds up.
BATCH, SUMS = ir.fixed("ADDED"), ir.fixed("sums")

#: Number of sites in a batch of a sum over pairs. Additions for different sites are independent, so the processor need
#: not wait for the result of the previous addition.
PAIR_BATCH = 32


@dataclass(frozen=True)
class Handed:
    """Contribution of each site to the cotangent of field ``base`` at the site that is ``offset`` away.

    The contributions of all sites are stored in the array with the number ``array``.
    """

    array: int
    base: int
    offset: tuple[int, ...]


@dataclass(frozen=True)
class Transpose:
    """A transposed function before the lowering, and the arrays that it reads and writes.

    - ``seed``: the kind of the symbols for the cotangents that the function reads
    - ``fields``: the numbers of the fields of the lattice to which these cotangents belong; if there are none, the
      function reads the arrays ``varied`` of the row
    - ``received``: the contributions of other sites to these cotangents, which an earlier loop has stored
    - ``handed``: the contributions to other sites, which the function stores
    - ``summed``: the number of sums over bonds or pairs on which the results depend
    - ``sums_from``: the number of the first array for the cotangents of these sums
    - ``recomputed``: the names of the fields of the lattice that the function also writes
    """

    function: ir.Function
    seed: str
    fields: tuple[int, ...] = ()
    handed: tuple[Handed, ...] = ()
    sums_from: int = 0
    summed: int = 0
    received: tuple[Handed, ...] = ()
    recomputed: frozenset[str] = frozenset()


def transposed(transpose: Transpose, layout: RowLayout, *, vectors: bool) -> ir.Function:
    """Return the first of two row functions that replace a transposed function; `handing` returns the second
    one.

    With ``vectors``, sums over sites are accumulated in SIMD registers.
    """
    loop, fields = transpose.function.loop, transpose.fields
    variations = [ir.fixed(f"v_{k}") for k in range(layout.lattice.program.dimension)]
    pointers = [ir.fixed(f"bar_{k}") for k in fields] or variations
    around = [ir.entry(ir.Member(ROW, "bar"), k) for k in fields]
    reading = Reading(transpose.recomputed, {transpose.seed: pointers, "around": around})
    rows, seeds = rows_of(transpose.function, layout, reading), _seeds(loop)
    handed_values, stores = _stores(transpose, rows)
    written_bars = {
        s.array.number for s in transpose.function.loop.stores if s.array.storage in _COTANGENTS and not any(s.offset)
    }
    written_bars |= {h.base for h in transpose.received} | {fields[k] for k in seeds if fields}
    colour = loop.selection.colour
    head: list[ir.Statement] = [_pointer("v", "varied", k, layout, READ) for k in seeds if not fields]
    head += [_pointer("bar", "bar", k, layout) for k in sorted(written_bars)]
    for array in handed_values:
        head.append(_pointer("handed", "handed", array, layout))
        if colour is not None:
            head.append(ir.Clear(ir.fixed(f"handed_{array}"), FROM, ir.Binary("-", TO, FROM)))
    received_pointers, added = _added_up("received", transpose.received, layout)
    body = (*added, *rows.at_site(), *rows.computed, *stores)
    shares = [s for s in loop.body if isinstance(s, ir.Reduce)]
    loops = (
        in_vectors(body, shares) if vectors and shares and colour is None else in_batches(body, shares, layout, colour)
    )
    statements = (*head, *received_pointers, *rows.before(), *loops)
    return row_function(transpose.function, "coef", "row", "sums", body=statements)


_COTANGENTS = (Storage.COTANGENT, Storage.START_COTANGENT)


def _stores(transpose: Transpose, rows: RowDeclarations) -> tuple[dict[int, ir.Value], list[ir.Statement]]:
    """Return a map and a list of statements.

    The map has the values that a site stores for its neighbours: number of an array → value that is stored in this
    array. The statements store these values, and all other results of the site.
    """
    places = {(h.base, h.offset): h.array for h in transpose.handed}
    handed_values: dict[int, ir.Value] = {}
    stores: list[ir.Statement] = []
    for s in transpose.function.loop.stores:
        number = s.array.number
        if s.array.storage is Storage.SUM_COTANGENT:
            handed_values[transpose.sums_from + number] = s.value
        elif s.array.storage is Storage.STATE:
            stores.append(ir.Assign(ir.Entry(rows.pointer(s.array.name), SITE), s.value))
        elif any(s.offset):
            handed_values.setdefault(places[number, s.offset], s.value)
        else:
            stores.append(ir.Assign(ir.Entry(ir.fixed(f"bar_{number}"), SITE), s.value, adds=True))
    arrays = [*(h.array for h in transpose.handed)]
    arrays += range(transpose.sums_from, transpose.sums_from + transpose.summed)
    handed_values |= {array: ZERO for array in arrays if array not in handed_values}
    stores += [ir.Assign(ir.Entry(ir.fixed(f"handed_{array}"), SITE), value) for array, value in handed_values.items()]
    return handed_values, stores


def handing(name: str, doc: str, handed: Sequence[Handed], layout: RowLayout) -> ir.Function:
    """Return the second of two row functions that replace a transposed function; `transposed` returns the first one. In
    the second function, each site adds the contributions that its neighbours have stored for it.
    """
    pointers, added = _added_up("handed", handed, layout)
    head = [_pointer("bar", "bar", k, layout) for k in dict.fromkeys(h.base for h in handed)]
    return ir.Function(name, doc, Role.OTHER, ("row",), (*pointers, *head, over_sites(added)))


def _added_up(
    prefix: str, handed: Sequence[Handed], layout: RowLayout
) -> tuple[list[ir.Statement], list[ir.Statement]]:
    """Return two lists: pointers to the contributions that neighbours have stored for a site, and the statements that
    add these contributions.
    """
    sums: dict[int, ir.Value] = {}
    pointers: dict[str, ir.Statement] = {}
    open_rows = prefix == "received" and any(layout.lattice.step.sites.open_axes[:-1])
    for h in handed:
        opposite = tuple(-o for o in h.offset)
        line = layout.line(opposite)
        name = f"{prefix}_{h.array}" + (f"_{line}" if line else "")
        place = layout.row(ir.entry(ir.Member(ROW, prefix), h.array), line, "givers" if open_rows else "at")
        pointers[name] = ir.Declare(READ, ((ir.fixed(name).symbol, place),))
        value = ir.Entry(ir.fixed(name), ir.plus(SITE, opposite[-1]))
        sums[h.base] = ir.joined("+", *([sums[h.base]] if h.base in sums else []), value)
    added = (ir.Assign(ir.Entry(ir.fixed(f"bar_{k}"), SITE), value, adds=True) for k, value in sums.items())
    return [*pointers.values()], [*added]


# ---- sums over sites


def in_batches(
    body: ir.Block, shares: Sequence[ir.Reduce], layout: RowLayout, colour: int | None
) -> Iterator[ir.Statement]:
    """Yield the loop over sites. If there are sums over sites, it contains an inner loop over a batch of sites.

    Each site of a batch then has its own partial sum for each of the sums ``shares``.
    """
    swept = ir.Constant(colour)
    if not shares:
        yield of_colour(body, colour, swept, layout, limit="end")
        return
    names = [ir.fixed(f"share{k}") for k in range(len(shares))]
    at_site = ir.Binary("-", SITE, BEGIN)
    added = (ir.Assign(ir.Entry(n, at_site), s.value, adds=True) for n, s in zip(names, shares, strict=True))
    count, left = ir.Binary("-", TO, FROM), ir.Binary("-", TO, BEGIN)
    yield ir.index(APART, ir.Select(ir.Binary("<", count, BATCH), count, ir.Cast(BATCH)))
    yield ir.vectors(ir.Vector(BATCH), *names)
    yield from (ir.Clear(n, None, APART) for n in names)
    end = ir.index(END, ir.Select(ir.Binary("<", left, BATCH), TO, ir.Binary("+", BEGIN, BATCH)))
    inner = of_colour((*body, *added), colour, swept, layout, BEGIN, high=END, limit="")
    yield ir.Loop("plain", (end, inner), "begin", FROM, TO, step=BATCH)
    yield from _totals(shares, "added", APART)


def in_vectors(body: ir.Block, shares: Sequence[ir.Reduce]) -> Iterator[ir.Statement]:
    """Yield a loop over SIMD vectors of 8 sites and a loop over the remaining sites. Partial sums stay in registers."""
    names = [ir.fixed(f"share{k}") for k in range(len(shares))]
    yield ir.vectors(ir.Vector(ir.Constant(8)), *names, value=ir.Listed((ZERO,)))
    rest = ir.Binary("%", ir.Binary("-", INDEX_TO, FROM), ir.Constant(8))
    yield ir.Declare(ir.Type.INDEX, ((INDEX_TO.symbol, TO), (WHOLE.symbol, ir.Binary("-", INDEX_TO, rest))))
    yield ir.index(LANES, ir.Called("LANES", (ir.Binary("-", WHOLE, FROM),)))
    adds = (ir.Call("ADD", (n, LANE, s.value)) for n, s in zip(names, shares, strict=True))
    lanes = (ir.index(SITE, ir.Binary("+", OTHER, LANE)), *body, *adds)
    inner = ir.Loop("plain", lanes, "l", ir.Constant(0), LANES, independent="LANE")
    yield ir.Loop("plain", (inner,), "j", FROM, WHOLE, step=LANES)
    single = (ir.Assign(ir.entry(n, 0), s.value, adds=True) for n, s in zip(names, shares, strict=True))
    yield ir.Loop("plain", (*body, *single), "i", WHOLE, INDEX_TO)
    yield from _totals(shares, "total")


def _totals(shares: Sequence[ir.Reduce], function: str, *arguments: ir.Value) -> Iterator[ir.Statement]:
    for k, s in enumerate(shares):
        total = ir.Called(function, (ir.fixed(f"share{k}"), *arguments))
        yield ir.Assign(ir.entry(SUMS, s.number), total, adds=True)


# ---- bonds and pairs


@dataclass(frozen=True)
class BondTranspose:
    """The transpose of a function that computes sums over bonds or pairs. There is one transpose for each end of the
    bonds: ``end`` is "a" or "b".

    The cotangents of the ``count`` sums are in the arrays from number ``sums_from`` on. ``oriented`` are names of
    parameters at bonds. The site at the end b of a bond reads these parameters with the opposite sign.
    """

    function: ir.Function
    end: str
    sums_from: int
    count: int
    oriented: frozenset[str] = frozenset()

    @property
    def updates(self) -> list[ir.Update]:
        """The statements in the loop of the function that store results or add to them."""
        return [s for s in self.function.loop.body if isinstance(s, ir.Update)]


def transposed_sums(transpose: BondTranspose, layout: RowLayout) -> ir.Function:
    """Return the transpose of a function for sums over bonds or pairs, as a function over a row segment."""
    updates, first = transpose.updates, transpose.sums_from
    arrays = [ir.fixed(f"handed_{first + k}") for k in range(transpose.count)]
    reading = Reading(seeds={HERE: arrays}, here=transpose.end, oriented=transpose.oriented)
    rows = rows_of(transpose.function, layout, reading)
    head = [*rows.before()]
    head += [_pointer("handed", "handed", first + k, None, ir.Pointer()) for k in _seeds(transpose.function.loop)]
    bars = {s.array.number for s in transpose.function.loop.stores if s.array.storage is Storage.COTANGENT}
    head += [_pointer("bar", "bar", k, None, ir.Pointer(constant=False)) for k in sorted(bars)]
    shares = [k for k, s in enumerate(updates) if isinstance(s, ir.Reduce)]
    head += [_zero(f"share{k}") for k in shares]
    loop_over_partners = _over_bonds if layout.lattice.step.others.graph else _over_pairs
    totals = (
        ir.Assign(ir.entry(SUMS, s.number), ir.fixed(f"share{k}"), adds=True)
        for k, s in enumerate(updates)
        if isinstance(s, ir.Reduce)
    )
    parameters = (*[p for p in transpose.function.parameters if p == "coef"], "row", "sums")
    return row_function(transpose.function, *parameters, body=(*head, loop_over_partners(transpose, rows), *totals))


def _over_bonds(transpose: BondTranspose, rows: RowDeclarations) -> ir.Loop:
    """Return the loop over sites, with an inner loop over the bonds of each site.

    For a sum over all sites, the contributions of the bonds are first added up at each site. Then the additions for
    different sites do not depend on each other.
    """
    updates = transpose.updates
    at_bonds = {k: s.array for k, s in enumerate(updates) if isinstance(s, ir.Store) and s.end == "bond"}
    inner = list[ir.Statement]()
    for k, s in enumerate(updates):
        changes_sign = k in at_bonds and at_bonds[k].name in transpose.oriented
        value = ir.Binary("*", SIDE, ir.Grouped(s.value)) if changes_sign else s.value
        place: ir.Value = ir.fixed(f"site_bar{k}")
        if k in at_bonds:
            place = ir.Entry(ir.fixed(f"bar_{at_bonds[k].number}"), BOND)
        inner.append(ir.Assign(place, value, adds=True))
    bonds = bonds_of(transpose.function.loop, rows, inner, ONE if transpose.end == "a" else ir.Constant(-1.0))
    summed = [k for k in range(len(updates)) if k not in at_bonds]
    zeros = (_zero(f"site_bar{k}") for k in summed)
    stores = (_into(updates[k], k, SITE, ir.fixed(f"site_bar{k}")) for k in summed)
    return over_sites((*together(rows.here), *zeros, bonds, *stores), "")


def _over_pairs(transpose: BondTranspose, rows: RowDeclarations) -> ir.Loop:
    """Return the loop over batches of sites, with an inner loop over all other sites.

    A batch consists of whole SIMD vectors of 8 sites, so rows are padded to whole vectors. For each pair of sites, all
    terms are computed before the first is added, since gcc does not vectorise the loop otherwise.
    """
    updates = transpose.updates
    first, left, count, batch = ir.fixed("first"), ir.fixed("left"), ir.fixed("count"), ir.Constant(PAIR_BATCH)
    rest = ir.Binary("-", INDEX_TO, first)
    vectors = ir.Binary("/", ir.Binary("+", left, ir.Constant(7)), ir.Constant(8))
    sizes = (
        (left.symbol, ir.Select(ir.Binary("<", rest, batch), rest, batch)),
        (count.symbol, ir.Binary("*", vectors, ir.Constant(8))),
    )
    partial_sums = [ir.fixed(f"site_bar{k}") for k in range(len(updates))]
    places = [ir.Entry(name, LANE) for name in partial_sums]
    site, same = ir.index(SITE, ir.Binary("+", first, LANE)), ir.Binary("==", SITE, OTHER)
    added = [ir.real(ir.fixed(f"add{k}"), ir.Select(same, ZERO, s.value)) for k, s in enumerate(updates)]
    add = (ir.Assign(place, ir.fixed(f"add{k}"), adds=True) for k, place in enumerate(places))
    inner = _lanes(count, (site, *together(rows.here), *rows.computed, *added, *add), independent="SITE")
    others = ir.Loop("plain", (*together(rows.other.items()), inner), "j", ir.Constant(0), LENGTH)
    stores = (_into(s, k, ir.Binary("+", first, LANE), places[k]) for k, s in enumerate(updates))
    body = (
        ir.Declare(ir.Type.INDEX, sizes),
        ir.vectors(ir.Vector(batch), *partial_sums),
        _lanes(count, tuple(ir.Assign(place, ZERO) for place in places)),
        others,
        _lanes(left, tuple(stores), note="the remaining entries belong to no site"),
    )
    return ir.Loop("plain", body, "first", FROM, TO, limit="to", step=batch)


def _lanes(count: ir.Value, body: ir.Block, *, independent: str = "", note: str = "") -> ir.Loop:
    return ir.Loop("plain", body, "l", ir.Constant(0), count, independent=independent, note=note)


def _into(s: ir.Update, k: int, site: ir.Value, value: ir.Value) -> ir.Assign:
    """Return the statement that uses ``value``, a sum over the bonds or pairs of one site.

    The statement adds the value to a cotangent or to a sum over sites, or stores the value at the site.
    """
    if isinstance(s, ir.Reduce):
        return ir.Assign(ir.fixed(f"share{k}"), value, adds=True)
    if s.array.storage is Storage.SUM:
        return ir.Assign(ir.Entry(gathered(s.array.number), site), value)
    return ir.Assign(ir.Entry(ir.fixed(f"bar_{s.array.number}"), site), value, adds=True)


def _zero(name: str) -> ir.Declare:
    return ir.real(ir.fixed(name), ZERO, mutable=True)


def _pointer(prefix: str, member: str, k: int, layout: RowLayout | None, kind: ir.Pointer = WRITTEN) -> ir.Declare:
    """Return the declaration of a pointer to an array. The row record has several lists of arrays: ``member`` is the
    name of the list, and ``k`` is the number of the array in this list.

    With a ``layout``, the pointer is to the first site of the segment in this array.
    """
    array = ir.entry(ir.Member(ROW, member), k)
    return ir.Declare(kind, ((ir.fixed(f"{prefix}_{k}").symbol, layout.row(array) if layout else array),))


def _seeds(loop: ir.Loop) -> list[int]:
    """Return the numbers of the outputs whose cotangents a loop reads at the site of the loop, or at the ends of a
    bond.
    """
    loads = (
        value for s in loop.body if isinstance(s, ir.Declare) for _, value in s.items if isinstance(value, ir.Load)
    )
    return sorted({v.array.number for v in loads if v.array.storage is Storage.SEED and not v.offset})
