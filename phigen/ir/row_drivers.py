"""Row drivers: functions of the generated C that call the loops over sites for each row segment of a lattice.

A row segment is a part of a row of sites; threads share the work by segments. The functions call loops that are lowered
by rows (`phigen.ir.passes.by_rows`). On a device that distributes row segments, loops of the kind "segments" are mapped
to threads.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from phigen.ir import nodes as ir
from phigen.ir.lattice_loops import bounds
from phigen.ir.passes.by_rows import FROM, ROW, TO, RowLayout
from phigen.ir.passes.function_parameters import discard_unread
from phigen.ir.walk import names_in, statements, values
from phigen.scheme.kernel import Role

S, UNIT, COEF, FULL_RANGE, PART, FLOW = (ir.fixed(name) for name in ("s", "unit", "coef", "full_range", "part", "flow"))
BEGIN, SECOND, THIRD, STOP, LOW, HIGH = (ir.fixed(name) for name in ("begin", "second", "third", "stop", "low", "high"))
SEGMENT = ir.Prefix("&", ROW)
LENGTH, STATE = ir.Member(S, "length"), ir.Member(S, "x")

#: Sites of a row segment: the first site, and the site after the last one. None stands for all sites of the segment.
Sites = tuple[ir.Value, ir.Value] | None
#: Three parts of a row segment: the sites away from open ends and boundary seams, the other sites near its first site,
#: and the other sites near its last site.
AWAY, FIRST_SITES, LAST_SITES = (SECOND, THIRD), (BEGIN, SECOND), (THIRD, STOP)

#: Number of sites in a SIMD vector. Loops that add whole vectors begin at multiples of this number, and rows are padded
#: to whole vectors.
VECTOR = 8


def whole_vectors(count: ir.Value) -> ir.Value:
    """Return the largest multiple of `VECTOR` that is at most ``count``."""
    return ir.Binary("&", count, ir.Prefix("~", ir.Cast(ir.Constant(VECTOR - 1))))


@dataclass(frozen=True)
class RowSegment:
    """Statements for one row segment: ``setup`` sets members of its record, and ``calls`` call the loops over its
    sites.

    ``orders`` are declarations that all segments share. The calls change some of the fields in ``arrays``; ``updated``
    has the indices of these fields. After the calls, the ends of the rows of these fields are copied to the halo. The
    halo has copies of sites beyond both ends of a row.
    """

    calls: ir.Block
    setup: ir.Block = ()
    orders: ir.Block = ()
    updated: Sequence[int] = ()
    arrays: ir.Value = STATE

    @property
    def near_ends(self) -> bool:
        """Whether there are separate calls for the sites near open ends or seams."""
        return divides(self.calls)


@dataclass(frozen=True)
class RowDrivers:
    """Builder of the row drivers of a lattice: functions of the C that process the row segments.

    ``halo`` is the number of sites in the halo on each side of a row. With ``may_be_empty``, there may be segments
    without sites. With ``one_loop``, a driver has one loop over row segments, and a switch inside the loop selects the
    part of H. Otherwise the switch is outside, and each part has its own loop.
    """

    layout: RowLayout
    halo: int
    may_be_empty: bool = False
    one_loop: bool = False

    def driver(
        self,
        name: str,
        doc: str,
        parameters: Sequence[str],
        cases: Sequence[RowSegment | ir.Block],
        labels: Sequence[int] = (),
        *,
        threads: int = 0,
        alone: bool = False,
        vectors: bool = False,
    ) -> ir.Function:
        """Return a function ``name`` that processes row segments by one of several ``cases``.

        The cases have the numbers 1, 2, …, or ``labels``; each is a `RowSegment` or a block of statements. By default,
        the function processes the segments ``first`` … ``end`` − 1. With ``threads``, it processes all segments, and
        uses several threads for lattices of more than ``threads`` sites. If ``alone``, it processes a single segment,
        without a loop. With ``vectors``, the number of sites near open ends is rounded up to whole SIMD vectors.
        """
        several = not alone and not threads
        range_names = ("first", "end") if several else ("unit",) * alone
        build = _Driver(self, threads, alone, vectors)
        body = build.over_segments(cases, labels or range(1, 1 + len(cases)))
        orders = dict.fromkeys(s for case in cases if isinstance(case, RowSegment) for s in case.orders)
        head: list[ir.Statement] = []
        if "flow" in parameters:
            head += self._part_of_flow(switched=len(cases) > 1)
        if threads and body:
            head.append(ir.Declare(ir.Type.SIZE, ((ir.fixed("units").symbol, ir.Called("units", (S,))),)))
        if orders:
            text = "fields in permuted order, so that a loop for one order of the fields serves for another"
            head.append(ir.Comment(text))
        said = ", on a row segment" * alone + ", on the row segments `first` ... `end` - 1" * several
        function = ir.Function(name, doc + said, Role.OTHER, ("s", *parameters, *range_names), (*head, *orders, *body))
        return discard_unread(function)

    def _part_of_flow(self, *, switched: bool) -> Iterator[ir.Statement]:
        """Yield the statement that finds the part of H for a flow of the schedule.

        The statement also assigns to the variable ``flow`` the colour that the flow updates.
        """
        arguments = (S, ir.Prefix("&", FLOW))
        if switched:
            yield ir.Declare(ir.Type.FLAG, ((PART.symbol, ir.Called("part_of_flow", arguments)),))
        else:
            yield ir.Call("part_of_flow", arguments)

    def first_of_row(self, arrays: ir.Value, number: int | ir.Value) -> ir.Value:
        """Return the address of the row of the segment in array ``number``."""
        index = ir.Constant(number) if isinstance(number, int) else number
        return self.layout.row(ir.Entry(arrays, index))

    def copied_ends(self, arrays: ir.Value, number: int | ir.Value, *, near_ends: bool = False) -> ir.Call:
        """Return the statement that copies the ends of the row of a field to the halo of this row.

        ``number`` is the number of the field in ``arrays``. The last two arguments of the call are the bounds of the
        row segment if the lattice is a single row. Otherwise they are the bounds of the whole row.
        """
        begin, stop = (BEGIN, STOP) if near_ends else (FROM, TO)
        swept = (begin, stop) if self.layout.single_row else (ir.Constant(0), LENGTH)
        return ir.Call("ends", (self.first_of_row(arrays, number), LENGTH, *swept))

    def divided(self, *, vectors: bool = False) -> Iterator[ir.Statement]:
        """Yield the declarations that divide a segment into sites near open ends or seams, and sites away from them."""
        sites = self.layout.lattice.step.sites
        reaches = [bounds(w.key)[-1] for w in self.layout.lattice.weights]
        below, above = max([0, *(-low for low, _ in reaches)]), max([0, *(high for _, high in reaches)])
        inside = [ir.entry(ir.Member(S, "inside"), k) for k in range(2)]
        low: ir.Value = ir.Constant((below + VECTOR - 1) // VECTOR * VECTOR if vectors else below)
        high = whole_vectors(ir.plus(LENGTH, -above)) if vectors else ir.plus(LENGTH, -above)
        away: ir.Value = ir.Member(ROW, "complete")
        if sites.seams:
            low, high = inside
            away = ir.Binary("==", ir.Member(ROW, "near_seams"), ir.Constant(0))
        if not self.layout.single_row:
            low = ir.Select(away, low, LENGTH)
        ends = "seams" if sites.seams else "open ends"
        yield ir.Comment(f"the sites i with second <= i < third are away from all {ends}")
        yield _indices((BEGIN, FROM), (STOP, TO), (LOW, low), (HIGH, high))
        below_low = ir.Select(ir.Binary("<", STOP, LOW), STOP, LOW)
        yield _indices((SECOND, ir.Select(ir.Binary(">", BEGIN, LOW), BEGIN, below_low)))
        below_second = ir.Select(ir.Binary("<", HIGH, SECOND), SECOND, HIGH)
        yield _indices((THIRD, ir.Select(ir.Binary("<", STOP, HIGH), STOP, below_second)))


@dataclass(frozen=True)
class _Driver:
    """Builder of one row driver. `RowDrivers.driver` explains the fields, which are options of this method."""

    drivers: RowDrivers
    threads: int
    alone: bool
    vectors: bool

    def over_segments(self, cases: Sequence[RowSegment | ir.Block], labels: Sequence[int]) -> ir.Block:
        """Return the loop over row segments, or a switch over several loops of this kind.

        Each case ends with a copy of the ends of rows to the halo, for the fields that the case updates. There is an
        exception: if one loop serves all parts of H, and the lattice is a single row with open ends, a statement after
        the switch copies the ends of all fields. Only the first and the last segment read these copies.
        """
        drivers, segments = self.drivers, [case for case in cases if isinstance(case, RowSegment)]
        copies = [[*self._copied_ends(case)] for case in segments]
        if len(segments) > 1 and drivers.one_loop:
            last: ir.Block = ()
            if drivers.layout.lattice.step.sites.open_axes == (True,) and any(copies):
                first, k = segments[0], ir.fixed("k")
                copy = drivers.copied_ends(first.arrays, k, near_ends=first.near_ends)
                last, copies = (ir.Loop("line", (copy,), "k", ir.Constant(0), ir.fixed("DIM")),), [[] for _ in copies]
            blocks = [(*case.calls, *copied) for case, copied in zip(segments, copies, strict=True)]
            setup = tuple(dict.fromkeys(s for case in segments for s in case.setup))
            calls = (ir.Switch(PART, tuple(labels), tuple(blocks)), *last)
            return self._segment(RowSegment(calls, setup))
        whole = iter([replace(c, calls=(*c.calls, *copied)) for c, copied in zip(segments, copies, strict=True)])
        loops = [self._segment(next(whole)) if isinstance(case, RowSegment) else case for case in cases]
        return loops[0] if len(loops) == 1 else (ir.Switch(PART, tuple(labels), tuple(loops)),)

    def _copied_ends(self, case: RowSegment) -> Iterator[ir.Statement]:
        for field in case.updated if self.drivers.halo else ():
            yield self.drivers.copied_ends(case.arrays, field, near_ends=case.near_ends)

    def _segment(self, case: RowSegment) -> ir.Block:
        """Return the loop over row segments that executes the statements of one case; () if the case has no calls."""
        if not case.calls:
            return ()
        piece = ((ROW.symbol, ir.Called("piece_of", (S, UNIT))),)
        body: list[ir.Statement] = [*case.setup]
        if self.drivers.may_be_empty and self.drivers.layout.single_row:
            body.append(ir.If(ir.Binary(">=", FROM, TO), (ir.Return() if self.alone else ir.Continue(),)))
        body += self.drivers.divided(vectors=self.vectors) if case.near_ends else ()
        body += case.calls
        body.insert(0, ir.Declare(ir.RecordType("row"), piece, mutable=_is_changed(tuple(body))))
        if self.alone:
            return tuple(body)
        low, high = (ir.Constant(0), ir.fixed("units")) if self.threads else (ir.fixed("first"), ir.fixed("end"))
        return (ir.Loop("segments", tuple(body), "unit", low, high, threads=self.threads),)


def at(sites: Sites) -> ir.Value:
    """Return the argument that passes a row segment to a loop. If ``sites`` is not None, the loop runs only over these
    sites of the segment.
    """
    return ir.Called("between", (SEGMENT, *sites)) if sites else SEGMENT


def divides(calls: ir.Block) -> bool:
    """Whether some of the ``calls`` are for a part of a segment, such as the sites near open ends or seams."""
    return not {SECOND.symbol, STOP.symbol}.isdisjoint(names_in(calls))


def in_forms(blocks: dict[str, ir.Block]) -> ir.Block:
    """Return a block that selects between functions for small and for all arguments by the flag ``full_range``.

    ``blocks`` has a block for each suffix of `phigen.ir.passes.forms`; a single block is returned as it is.
    """
    if len(blocks) == 1:
        return next(iter(blocks.values()))
    return (ir.If(FULL_RANGE, blocks["_full_range"], blocks["_near"]),)


def member(name: str, value: ir.Value) -> ir.Assign:
    """Return the assignment of a value to the member ``name`` of the record of a row segment."""
    return ir.Assign(ir.Member(ROW, name), value)


def _is_changed(body: ir.Block) -> bool:
    """Whether statements change the record of a row segment. A call for a part of the segment also changes the
    record.
    """
    assigned = (a.target for s in statements(body) for a in (s.assignments if isinstance(s, ir.Together) else [s])
                if isinstance(a, ir.Assign))  # fmt: skip
    between = any(isinstance(v, ir.Called) and v.name == "between" for v in values(body))
    return between or any(isinstance(place, ir.Member) and place.record == ROW for place in assigned)


def _indices(*items: tuple[ir.Name, ir.Value]) -> ir.Declare:
    return ir.Declare(ir.Type.INDEX, tuple((name.symbol, value) for name, value in items))
