"""Lowering by rows, for C: a row function runs over the sites of a row segment.

For each array, the function declares pointers to the rows that it reads: the row of the segment, and neighbouring rows.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from phigen.ir import nodes as ir
from phigen.ir.lattice_loops import LatticeLoops
from phigen.ir.nodes import Storage
from phigen.symbolic.symbols import Symbol

#: Variables of loops: the index of the site, the index of the other site of a bond or pair, the index of the bond, the
#: direction of the bond (1 or −1), and the record of the row segment.
SITE, OTHER, BOND, SIDE, ROW = (ir.fixed(name) for name in ("i", "j", "k", "side", "row"))
SOLVER, AT_BONDS = ir.Member(ROW, "s"), ir.Member(ir.Member(ROW, "s"), "at_bonds")
FROM, TO, LENGTH = ir.Member(ROW, "from"), ir.Member(ROW, "to"), ir.Member(SOLVER, "length")

READ, WRITTEN = ir.Pointer(constant=True, restricted=True), ir.Pointer(constant=False, restricted=True)
#: For each kind of storage, the member of the row record that holds the arrays of this kind.
_MEMBERS = {Storage.STATE: "x", Storage.VARIATION: "varied", Storage.START: "start", Storage.OUTPUT: "out"}


@dataclass(frozen=True)
class RowLayout:
    """Layout of a lattice in rows.

    ``lines`` are the rows that functions read, as offsets relative to the row of the loop. ``members`` maps parameters
    to the names of their members in the record ``params``.
    """

    lattice: LatticeLoops
    lines: tuple[tuple[int, ...], ...]
    members: Mapping[str, str]

    @property
    def single_row(self) -> bool:
        """Whether the lattice has one axis, and therefore one row."""
        return len(self.lattice.step.sites.axes) == 1

    @property
    def colour_step(self) -> int:
        """The distance between successive sites of one colour in a row."""
        sites = self.lattice.step.sites
        return next(k for k in range(1, sites.colours + 1) if k * sites.weights[-1] % sites.colours == 0)

    def line(self, offset: Sequence[int]) -> int:
        """Return the index in ``lines`` of the row in which the neighbour at an ``offset`` lies."""
        return self.lines.index(tuple(offset[:-1])) if any(offset) else 0

    def place(self, line: int) -> str:
        """Return the position of row ``line`` relative to the row of the loop, such as "i + 1", as text for a
        comment.
        """
        axes = zip(self.lattice.step.sites.axes, self.lines[line], strict=False)
        return ", ".join(f"{axis} {'+' if o > 0 else '-'} {abs(o)}" for axis, o in axes if o)

    def row(self, arrays: ir.Value, line: int = 0, rows: str = "at") -> ir.Value:
        """Return the address of row number ``line`` in an array.

        A member of the row record has the offsets of the rows in memory; ``rows`` is the name of this member.
        """
        return arrays if self.single_row else ir.Binary("+", arrays, ir.entry(ir.Member(ROW, rows), line))


@dataclass(frozen=True)
class Reading:
    """Options of `RowDeclarations`. They say how a function accesses arrays.

    ``updated`` are the fields that the function writes. ``seeds`` maps each kind of cotangents to the arrays with these
    cotangents. With ``local``, the function sums over the bonds of a site in local variables. ``here`` is "a" or "b":
    the end of the bond or pair at which the site of the loop lies. ``at_bonds`` is the array of parameters at bonds.
    The parameters ``oriented`` have the opposite sign for the site at the end b.
    """

    updated: frozenset[str] = frozenset()
    seeds: Mapping[str, Sequence[ir.Value]] = field(default_factory=dict)
    local: bool = False
    here: str = "a"
    oriented: frozenset[str] = frozenset()
    at_bonds: ir.Value = AT_BONDS


@dataclass
class RowDeclarations:
    """Declarations of the values that a function reads, sorted by the place where they are printed.

    The places are before the loop over sites, at its beginning, and inside an inner loop over the other ends of bonds
    or pairs.
    """

    layout: RowLayout
    reading: Reading = field(default_factory=Reading)
    once: list[tuple[str, ir.Value]] = field(default_factory=list)
    substituted: list[ir.Statement] = field(default_factory=list)
    starts: dict[str, tuple[ir.Pointer, ir.Value]] = field(default_factory=dict)
    rows: dict[tuple[str, int], ir.Name] = field(default_factory=dict)
    loaded: dict[str, ir.Value] = field(default_factory=dict)
    weights: list[ir.Statement] = field(default_factory=list)
    here: list[tuple[str, ir.Value]] = field(default_factory=list)
    other: dict[str, ir.Value] = field(default_factory=dict)
    computed: list[ir.Statement] = field(default_factory=list)

    def read(self, body: Iterable[ir.Statement]) -> RowDeclarations:
        """Record the declarations in ``body``, and return this object.

        Declarations of temporaries are recorded in ``computed``.
        """
        for s in body:
            match s:
                case ir.Declare(items=((name, value),)):
                    self._declare(s, name, value)
        return self

    def _declare(self, s: ir.Declare, name: str, value: ir.Value) -> None:
        match value:
            case ir.Coefficient(k):
                self._once(name, ir.fixed(f"c{k}"), ir.entry(ir.fixed("coef"), k))
            case ir.Time():
                self.once.append((name, ir.Member(SOLVER, "now")))
            case ir.SystemParameter(parameter):
                self.once.append((name, ir.Member(ir.Member(SOLVER, "params"), self.layout.members[parameter])))
            case ir.BondParameter(number, parameter):
                at_bond = ir.Entry(ir.entry(self.reading.at_bonds, number), BOND)
                oriented = parameter in self.reading.oriented
                self.other[name] = ir.Binary("*", SIDE, at_bond) if oriented else at_bond
            case ir.HasColour():
                chosen = ir.Binary("==", ir.Entry(ir.Member(SOLVER, "colours"), SITE), ir.Member(ROW, "chosen"))
                self._substitute(name, ir.Select(chosen, ir.Constant(1.0), ir.Constant(0.0)))
            case ir.Inside():
                self._inside(name, value)
            case ir.OnSeam():
                self._on_seam(name, value)
            case ir.Load():
                self._load(name, value)
            case _:
                self.computed.append(s)

    def _once(self, name: str, local_name: ir.Name, value: ir.Value) -> None:
        self.once.append((local_name.symbol, value))
        self._substitute(name, local_name)

    def _substitute(self, name: str, value: ir.Value) -> None:
        self.substituted.append(ir.in_place(name, value))

    def _load(self, name: str, load: ir.Load) -> None:
        array, beside = load.array, any(load.offset)
        match array.storage:
            case Storage.SUM if self.reading.local:
                self._substitute(name, ir.fixed(f"sum{array.number}"))
            case Storage.SUM:
                self._substitute(name, ir.Entry(gathered(array.number), SITE))
            case Storage.SEED if load.offset:
                line = self.layout.line(load.offset)
                pointer = ir.Name(Symbol("around", array.number, line))
                self._start(pointer, READ, self.layout.row(self.reading.seeds["around"][array.number], line))
                self._substitute(name, _beside(pointer, load))
            case Storage.SEED:
                self._at_end(name, self.reading.seeds[array.name][array.number], load)
            case Storage.START:
                pointer = ir.Name(Symbol("start", array.name))
                self._start(pointer, READ, self.layout.row(_member(array)))
                self._substitute(name, ir.Entry(pointer, SITE))
            case Storage.VARIATION:
                line = self.layout.line(load.offset)
                pointer = ir.Name(Symbol("varied", array.name, line))
                self._start(pointer, ir.Pointer(), self.layout.row(_member(array), line))
                if load.end:
                    self._at_end(name, pointer, load)
                else:
                    self._substitute(name, _beside(pointer, load))
            case _:
                pointer = self.pointer(array.name, self.layout.line(load.offset))
                if load.end == self.reading.here and self.reading.local:
                    self._substitute(name, ir.Name(array.name))
                    self.loaded[array.name] = ir.Entry(pointer, SITE)
                elif beside:
                    self._substitute(name, _beside(pointer, load))
                else:
                    self._at_end(name, pointer, load)

    def _at_end(self, name: str, pointer: ir.Value, load: ir.Load) -> None:
        """Record the declaration of the variable ``name``. The variable has the value at the site of the loop or, in
        loops over bonds or pairs, the value at the other site.
        """
        if not load.end:
            self.loaded[name] = ir.Entry(pointer, SITE)
        elif load.end == self.reading.here:
            self.here.append((name, ir.Entry(pointer, SITE)))
        else:
            self.other[name] = ir.Entry(pointer, OTHER)

    def _inside(self, name: str, value: ir.Inside) -> None:
        local_name, number = ir.fixed(f"w{value.number}"), ir.Constant(value.number)
        in_row: ir.Value = ir.Entry(ir.Member(ROW, "present"), number)
        low, high = value.bounds[-1]
        tests = [ir.Binary(">=", ir.plus(SITE, low), ir.Constant(0))] * (low < 0)
        tests += [ir.Binary("<", ir.plus(SITE, high), LENGTH)] * (high > 0)
        if not tests:
            self._once(name, local_name, in_row)
            return
        in_open_rows: ir.Value = ir.Constant(1.0)
        if not self.layout.single_row:  # gcc does not vectorise a loop that reads this value
            in_open_rows = ir.fixed(f"there{value.number}")
            self.once.append((in_open_rows.symbol, in_row))
        condition = tests[0] if len(tests) == 1 else ir.Binary("and", *tests)
        self._weight(name, local_name, ir.Select(condition, in_open_rows, ir.Constant(0.0)))

    def _on_seam(self, name: str, value: ir.OnSeam) -> None:
        line = self.layout.line(value.offset)
        kinds, window = ir.Name(Symbol("kinds", line)), ir.Name(Symbol("window"))
        self._start(kinds, READ, self.layout.row(ir.Member(SOLVER, "kinds"), line))
        if (window.symbol, ir.Member(ROW, "window")) not in self.once:
            self.once.append((window.symbol, ir.Member(ROW, "window")))
        seam_kind = ir.Binary("+", window, ir.Constant(float(value.colour)))
        matches = ir.Binary("==", ir.Entry(kinds, ir.plus(SITE, value.offset[-1])), seam_kind)
        self._weight(name, ir.fixed(f"w{value.number}"), ir.Select(matches, ir.Constant(1.0), ir.Constant(0.0)))

    def _weight(self, name: str, local_name: ir.Name, value: ir.Value) -> None:
        self.weights.append(ir.real(local_name, value))
        self._substitute(name, local_name)

    def _start(self, pointer: ir.Name, kind: ir.Pointer, row: ir.Value) -> None:
        self.starts.setdefault(pointer.symbol, (kind, row))

    def pointer(self, base: str, line: int = 0) -> ir.Name:
        """Return the pointer to row ``line`` of the array ``base`` of the state. The pointer is declared at its first
        use.
        """
        return self.rows.setdefault((base, line), ir.label(f"{base}_row{line or ''}"))

    def before(self) -> Iterator[ir.Statement]:
        """Yield the declarations that are printed before the loop over sites."""
        for updated in sorted(self.reading.updated):
            self.pointer(updated)
        pointers, neighbour_pointers = dict(self.starts), list[ir.Statement]()
        for (base, line), name in self.rows.items():
            written = base in self.reading.updated
            kind = ir.Pointer(constant=not (written and line == 0), restricted=not written)
            number = self.layout.lattice.arrays.index(base)
            row = self.layout.row(ir.entry(ir.Member(ROW, "x"), number), line)
            if line:
                neighbour_pointers.append(ir.Declare(kind, ((name.symbol, row),), note=self.layout.place(line)))
            else:
                pointers[name.symbol] = kind, row
        yield from (*self.substituted, *together(self.once), *grouped(pointers), *neighbour_pointers)

    def at_site(self) -> list[ir.Statement]:
        """Return the declarations that are printed at the beginning of the loop over sites."""
        return [*together(self.loaded.items()), *self.weights]


def rows_of(function: ir.Function, layout: RowLayout, reading: Reading | None = None) -> RowDeclarations:
    """Return the declarations of the values that a function reads. The function is not lowered yet."""
    rows = RowDeclarations(layout, reading or Reading())
    return rows.read((*function.body, *function.loop.body))


def over_sites(body: Iterable[ir.Statement], independent: str = "SITE", **fields: object) -> ir.Loop:
    """Return the loop over the sites of a row segment."""
    loop = ir.Loop("row", tuple(body), low=FROM, high=TO, limit="to", independent=independent)
    return replace(loop, **fields)  # type: ignore[arg-type]


def together(values: Iterable[tuple[str, ir.Value]]) -> list[ir.Statement]:
    """Return a single declaration of several real constants; [] if ``values`` is empty."""
    items = tuple(values)
    return [ir.Declare(ir.Type.REAL, items)] if items else []


def grouped(pointers: Mapping[str, tuple[ir.Pointer, ir.Value]]) -> Iterator[ir.Statement]:
    """Yield the declarations of pointers, with all pointers of one type in one declaration."""
    for kind in dict.fromkeys(kind for kind, _ in pointers.values()):
        yield ir.Declare(
            kind, tuple((name, row) for name, (pointer_kind, row) in pointers.items() if pointer_kind == kind)
        )


def _member(array: ir.Array) -> ir.Value:
    return ir.entry(ir.Member(ROW, _MEMBERS[array.storage]), array.number)


def gathered(number: int) -> ir.Value:
    """Return the array of a sum over bonds or pairs, with one entry for each site. ``number`` is the number of
    the sum.
    """
    return ir.entry(ir.Member(SOLVER, "gathered"), number)


def _beside(pointer: ir.Name, load: ir.Load) -> ir.Value:
    return ir.Entry(pointer, ir.plus(SITE, load.offset[-1] if load.offset else 0))
