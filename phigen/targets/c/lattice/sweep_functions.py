"""The sweeps of a lattice in C: row functions, which run over the sites of a row segment, and row drivers, which call
row functions for all row segments.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from phigen.ir import nodes as ir
from phigen.ir import row_drivers
from phigen.ir.lattice_parameters import copies
from phigen.ir.passes.by_rows import ROW
from phigen.ir.passes.open_ends import NEAR_ENDS
from phigen.ir.row_drivers import (
    AWAY,
    COEF,
    FIRST_SITES,
    LAST_SITES,
    LENGTH,
    SEGMENT,
    STATE,
    RowDrivers,
    RowSegment,
    S,
    at,
)
from phigen.lanes.in_lanes import Rows
from phigen.scheme.bond_ends import over_ends
from phigen.scheme.kernel import Kernel, Role
from phigen.scheme.program import Program
from phigen.scheme.reordered_sweeps import orders, other_ways, turned, turned_increments
from phigen.scheme.stage_kernels import site_block
from phigen.scheme.steps import Sweep, Sweeps
from phigen.scheme.sweep_facts import beside_seams, first_kind, wide
from phigen.symbolic.special import SPECIAL
from phigen.targets.c import functions
from phigen.targets.c.language import members
from phigen.targets.c.lattice.layout import Layout, layout_of, switches
from phigen.targets.c.lattice.loops import (
    RowLoops,
    code,
    observables,
    printed,
)
from phigen.targets.c.loops import commented


def sweeps(program: Program, step: Sweeps, rows: Rows) -> str:
    """Return the text of all kernels as loops over sites, and of the functions that apply the flow of each part of
    H.
    """
    layout = layout_of(program, step)
    loops, equation = RowLoops(layout), step.equation
    texts = functions.phi_lanes(program, set(rows.small_argument))
    texts += functions.near_rows(program, [f for f in rows.small_argument if f not in SPECIAL])
    if step.parts:
        texts += _PartLoops(loops, rows, step.parts).texts()
        texts += _PartLoops(loops, None, step.tangents).texts() if program.extras.tangent else []
    partners = layout.partners
    of_parts = (sums for _, sums in partners.of_parts)
    others = (partners.field, partners.energy, partners.varied, partners.observed, *of_parts)
    for gather in () if layout.sums_up else others:
        texts += [printed(program, loop) for loop in loops.sums(gather)]
    if equation:
        texts += _of_equation(loops, equation.relax, rows, end=equation.advance)
        if switches(layout)["SITE_BLOCKS"]:
            texts += _of_equation(loops, site_block(step, program.coordinates, equation.relax))
        for kernel in (equation.slope, *equation.tangents) if layout.slopes else ():
            texts += _of_equation(loops, kernel)
    return "\n".join([*texts, *observables(loops)])


def parameters(program: Program, step: Sweeps) -> str:
    """Return the text of the functions that copy parameters at sites and bonds to the arrays that loops read."""
    arrays = layout_of(program, step).lattice.arrays
    listed = copies(program.parameters, members(program), arrays, step.sites.at_bonds)
    return "".join(commented(copy, program) + "\n" for copy in listed)


def drivers(loops: RowLoops) -> RowDrivers:
    """Return the builder of the functions that call loops for the row segments of a lattice; see
    `phigen.ir.row_drivers`.
    """
    by_hand = switches(loops.layout)["BY_HAND"]
    return RowDrivers(loops.layout, loops.layout.halo, may_be_empty=by_hand, one_loop=not loops.fast)


@dataclass(frozen=True)
class _Call:
    """Call of a loop for some sites of a row segment.

    If ``order`` is not empty, the loop reads the fields in this order. If ``bonds`` is not empty, it reads the
    parameters at bonds in this order. Before the call, two values are stored in the record of the segment: the
    ``colour`` of the sweep, and its ``window``, the set of boundary seams that the sweep treats. ``shared`` is the name
    of the loop if several parts of H call it. ``others`` are calls with the same effect, but of other loops. Each of
    them may replace this call.
    """

    loop: ir.Function
    sites: row_drivers.Sites = None
    arguments: tuple[ir.Value, ...] = ()
    order: tuple[str, ...] = ()
    bonds: tuple[str, ...] = ()
    colour: int | None = None
    window: int | None = None
    shared: str = ""
    others: tuple[_Call, ...] = ()


#: The calls that apply the flow of a part of H, by the form of elementary functions (`phigen.ir.passes.forms`).
Calls = dict[str, list[_Call]]
Names = Mapping[tuple[tuple[str, ...], ir.Block], str]


def _purpose(loop: ir.Function, name: str) -> str:
    """Return the comment on a loop. In the generated C, the loop has the name ``name``.

    The comment on a loop for arguments of any size refers to the loop for small arguments, which has the same name up
    to the suffix.
    """
    before, after = (text.partition("_full_range")[0] for text in (loop.name, name))
    return loop.doc.replace(f"{before}_near", f"{after}_near")


@dataclass(frozen=True)
class _PartLoops:
    """The loops and row drivers of all parts of H. If ``rows`` is None, they compute the derivatives of the flows along
    variations, else the flows themselves.
    """

    loops: RowLoops
    rows: Rows | None
    parts: Sequence[Sequence[Sweep]]

    @property
    def varied(self) -> bool:
        """Whether the parts update variations (tangent vectors) of fields, not the fields."""
        return self.rows is None

    @property
    def by_part(self) -> bool:
        """Whether each part has its own function that runs over the rows. This is faster for short rows."""
        return self.loops.fast and not self.loops.layout.single_row and not self.varied

    def texts(self) -> Iterator[str]:
        """Yield the text of the loops and of the row drivers. Loops with equal code are printed once."""
        program, layout, step = self.loops.program, self.loops.layout, self.loops.layout.step
        calls_of_parts = [self._calls_of_part(part) for part in self.parts]
        alike = _alike(calls_of_parts)
        names: dict[tuple[tuple[str, ...], ir.Block], str] = {}
        for key, same in alike.items():
            shared = same[0].shared if len(same) > 1 and same[0].shared not in names.values() else ""
            loop = replace(same[0].loop, name=shared or same[0].loop.name)
            names[key] = loop.name
            yield printed(program, loop, [_purpose(call.loop, loop.name) for call in same])
        has, coloured = switches(layout), bool(step.by_colour)
        threads = 0 if self.varied or has["SHARED"] else 512 if has["PAIRS"] else 4096
        name = (
            "tangent_rows" if self.varied else f"sweep_{'colour' if coloured else 'part'}" if threads else "sweep_rows"
        )
        parameters = ["flow" if coloured else "part", "coef", *["v"] * self.varied]
        parameters += ["full_range"] * (self.rows is not None and bool(self.rows.limited))
        cases, build = list[RowSegment | ir.Block](), drivers(self.loops)
        for k, forms in enumerate(calls_of_parts):
            if not self.by_part:
                cases.append(self._segment(k, forms, names))
                continue
            for form in sorted(forms):
                range_text = ", with functions for arguments of any size" * (form == "_full_range")
                title = f"The flow of H_{k + 1}{range_text}"
                case = self._segment(k, {form: forms[form]}, names)
                yield commented(build.driver(f"rows{k + 1}{form}", title, ["coef"], [case]), program)
            arguments = (S, COEF, ir.fixed("first"), ir.fixed("end"))
            blocks: dict[str, ir.Block] = {form: (ir.Call(f"rows{k + 1}{form}", arguments),) for form in forms}
            cases.append(row_drivers.in_forms(blocks))
        if step.relative:
            yield self._gathering(step.relative.remainder, threads)
        title = "flow number `flow` of a stage" if coloured else "the flow of a part of H"
        title = f"Derivative of {title} along a tangent vector" if self.varied else title[0].upper() + title[1:]
        yield commented(build.driver(name, title, parameters, cases, threads=threads), program)

    def _gathering(self, remainder: int, threads: int) -> str:
        """Return the text of the function that computes sums over pairs of bodies in relative coordinates.

        The flow of one part of H uses these sums, and ``remainder`` is the index of this part. If ``threads`` is not 0,
        the function uses several threads for lattices of more than ``threads`` sites.
        """
        layout, program = self.loops.layout, self.loops.program
        gathers = [sweep.gather for sweep in self.parts[remainder] if sweep.gather]
        calls = tuple(ir.Call(e.kernel.name, (COEF, SEGMENT)) for gather in gathers for e in gather.ends)
        placed = ir.Member(S, "placed") if switches(layout)["JACOBI"] else STATE
        setup = [row_drivers.member("x", placed)]
        setup += [row_drivers.member("varied", ir.fixed("v"))] * self.varied
        name = "gather_tangent_rows" if self.varied else "gather_part" if threads else "gather_rows"
        title = "The sums over other bodies" + ", and their variations" * self.varied
        case = RowSegment(calls, tuple(setup))
        parameters = ["coef", *["v"] * self.varied]
        return commented(drivers(self.loops).driver(name, title, parameters, [case], threads=threads), program)

    def _calls_of_part(self, part: Sequence[Sweep]) -> Calls:
        """Return the calls that apply the flow of a part of H to a row segment, for each form of elementary
        functions.

        In profiles other than ``fast``, sweeps may share a loop if they differ only in the order of the fields.
        """
        layout, program = self.loops.layout, self.loops.program
        forms = self.loops.forms(self.rows, [self.loops.sites.sweep(sweep) for sweep in part])
        fields, calls_of_forms = program.coordinates, Calls()
        tried = [] if self.loops.fast or self.varied else [*orders(fields)]
        for form, versions in forms.items():
            calls_of_forms[form] = []
            for sweep in part:
                calls = [*self._calls(sweep, form, versions)]
                # In solvers with gradients, a sweep that reads sums does not share the loop of another sweep, since the
                # reverse pass has separate loops for the sums of each sweep.
                for order in () if sweep.gather and layout.step.adjoint else tried:
                    other = turned(layout.step.sites, fields, order, sweep)
                    for k, call in enumerate(self._calls(other, form, versions) if other else ()):
                        more = (replace(c, order=order) for c in (call, *call.others))
                        calls[k] = replace(calls[k], others=(*calls[k].others, *more))
                calls_of_forms[form] += calls
        return calls_of_forms

    def _calls(self, sweep: Sweep, form: str, versions: Mapping[str, str]) -> Iterator[_Call]:
        """Yield the calls of the loops of a sweep, in the order in which a row segment executes them."""
        layout, program = self.loops.layout, self.loops.program
        meant = over_ends(sweep.gather) if sweep.gather else []

        def arguments(k: int, bonds: tuple[str, ...], sign: float) -> tuple[ir.Value, ...]:
            across = ir.Constant(int(meant[k][0].chosen == "there"))
            at_bonds = ir.label("_".join(bonds)) if bonds else ir.Member(S, "at_bonds")
            values = {"at_bonds": at_bonds, "sign": ir.Constant(sign), "across": across}
            return tuple(values[name] for name in self.loops.bond_arguments(*meant[k]))

        for k, loop in enumerate(self.loops.sums(sweep.gather, swept=True)):
            others = list[_Call]()
            alone = self.loops.fast or layout.step.adjoint
            ways = () if alone or not sweep.gather else other_ways(layout.step.sites, sweep.gather)
            for gather, bonds, sign in ways:
                again = [*self.loops.sums(gather, swept=True)]
                others.append(_Call(again[k], None, arguments(k, bonds, sign), bonds=bonds))
            yield _Call(loop, None, arguments(k, (), 1.0), others=tuple(others))
        loops = self.loops.sweep(sweep, form, versions)
        swept = not self.loops.fast and layout.step.sites.colours > 1 and not sweep.is_tangent
        colour, window = sweep.colour if swept else None, first_kind(layout.step.sites, sweep)
        called = calls_of(loops, sweep)
        if len(loops) == 1 and wide(layout.step.sites, sweep):
            up = row_drivers.whole_vectors(ir.Binary("+", LENGTH, ir.Constant(row_drivers.VECTOR - 1)))
            called, colour, window = [(loops[0], (ir.Constant(0), up))], None, None
        fields = [program.coordinates[i] for i in sweep.moved]
        shared = "_".join(["tangent" if sweep.is_tangent else "sweep", *fields]) + form
        for loop, sites in called:
            end = loop.name.removeprefix(sweep.kernel.name + form)
            yield _Call(loop, sites, colour=colour, window=window, shared=shared + end)

    def _segment(self, k: int, forms: Mapping[str, Sequence[_Call]], names: Names) -> RowSegment:
        """Return the statements that apply the flow of part ``k`` to a row segment. ``names`` maps the code of a loop
        to the name of the loop.
        """
        layout, coloured = self.loops.layout, self.loops.layout.step.by_colour
        setup = [row_drivers.member("varied", ir.fixed("v"))] * self.varied
        setup += [row_drivers.member("chosen", row_drivers.FLOW)] * bool(coloured and coloured[k])
        near = [*_near_seams(layout, self.parts[k])] if self.by_part else []
        if layout.step.relative:  # separate row drivers compute the sums
            names_of_sums = {e.kernel.name for s in self.parts[k] if s.gather for e in s.gather.ends}
            forms = {f: [c for c in called if c.loop.name not in names_of_sums] for f, called in forms.items()}
        calls = [call for called in forms.values() for call in called]
        declared = [*_reordered(layout, [call.order for call in calls])]
        declared += _other_bonds(layout, [call.bonds for call in calls])
        blocks = {form: tuple(_statements(called, names)) for form, called in forms.items()}
        updated = sorted({f for sweep in self.parts[k] for f in sweep.moved})
        arrays = ir.fixed("v") if self.varied else STATE
        return RowSegment(row_drivers.in_forms(blocks), (*setup, *near), tuple(declared), updated, arrays)


def _alike(calls_of_parts: Sequence[Calls]) -> dict[tuple[tuple[str, ...], ir.Block], list[_Call]]:
    """Return a map from the code of each loop to the calls of loops with this code.

    If an earlier loop can do the work of a loop, the earlier loop is called instead.
    """
    alike: dict[tuple[tuple[str, ...], ir.Block], list[_Call]] = {}
    for calls_of_forms in calls_of_parts:
        for called in calls_of_forms.values():
            for k, call in sorted(enumerate(called), key=_place):
                called[k] = next((c for c in (call, *call.others) if code(c.loop) in alike), call)
                known = alike.setdefault(code(called[k].loop), [])
                if all(c.loop.name != call.loop.name for c in known):
                    known.append(called[k])
    return alike


def _place(numbered: tuple[int, _Call]) -> tuple[str, bool]:
    """Return the sort key of a loop in the file: a loop for sites near open ends comes after the loop for other
    sites.
    """
    name = numbered[1].loop.name
    return name.removesuffix(NEAR_ENDS), name.endswith(NEAR_ENDS)


def _near_seams(layout: Layout, part: Sequence[Sweep]) -> Iterator[ir.Statement]:
    """Yield the statements that skip rows and sites away from boundary seams, if the terms of a part of H occur only
    near seams.
    """
    window, last = max((s.window or 0 for s in part), default=0), len(layout.step.sites.axes) - 1
    rows, near = ir.Constant(window & ~(1 << last)), ir.Member(ROW, "near_seams")
    if rows.value:
        yield ir.If(ir.Binary("!=", ir.Binary("&", near, rows), rows), (ir.Continue(),))
    if window >> last:
        yield ir.Assign(near, ir.Constant(0))


def _statements(called: Sequence[_Call], names: Names) -> Iterator[ir.Statement]:
    """Yield the statements that call loops. Before each call, the values that the loop reads are stored in the record
    of the segment.
    """
    order: tuple[str, ...] = ()
    colour: int | None = 0
    window: int | None = 0
    for call in called:
        assignments = list[ir.Assign]()
        if call.window not in (window, None):
            window = call.window
            assignments.append(row_drivers.member("window", ir.Constant(float(window or 0))))
        if call.colour not in (colour, None):
            colour = call.colour
            assignments.append(row_drivers.member("swept", ir.Constant(colour)))
        if call.order != order:
            order = call.order
            assignments.append(row_drivers.member("x", ir.label("_".join(order)) if order else STATE))
        yield from [ir.Together(tuple(assignments))] if assignments else []
        yield ir.Call(names[code(call.loop)], (COEF, at(call.sites), *call.arguments))


def _other_bonds(layout: Layout, used: Sequence[tuple[str, ...]]) -> Iterator[ir.Statement]:
    """Yield the declarations of arrays with pointers to the parameters at bonds. Each nonempty tuple in ``used`` is the
    order of the parameters in one array.
    """
    listed = layout.step.sites.at_bonds
    for order in dict.fromkeys(order for order in used if order):
        yield _arrays(order, [ir.entry(ir.Member(S, "at_bonds"), listed.index(p)) for p in order])


def _reordered(layout: Layout, used: Sequence[tuple[str, ...]]) -> Iterator[ir.Statement]:
    """Yield the declarations of arrays with pointers to fields and to parameters at sites. Each nonempty tuple in
    ``used`` is the order of the fields in one array.
    """
    for order in dict.fromkeys(order for order in used if order):
        increments = turned_increments(layout.step.sites, layout.lattice.arrays, order)
        other = {**dict(zip(layout.lattice.arrays, order, strict=False)), **increments}
        places = [layout.lattice.arrays.index(other.get(a, a)) for a in layout.lattice.arrays]
        yield _arrays(order, [ir.entry(STATE, place) for place in places])


def _arrays(order: tuple[str, ...], arrays: Sequence[ir.Value]) -> ir.Declare:
    return ir.Declare(ir.Type.ARRAYS, ((ir.label("_".join(order)).symbol, ir.Listed(tuple(arrays))),))


def calls_of(loops: Sequence[ir.Function], sweep: Sweep | None = None) -> list[tuple[ir.Function, row_drivers.Sites]]:
    """Return the loops with the sites for which each is called. A loop may occur twice.

    Without open ends there is one loop, for all sites. If a sweep is restricted by boundary seams, the loop is called
    for the sites away from seams, or twice for the sites near seams at both ends of a row. With open ends there may be
    two loops: one for sites away from the ends, and one for sites near them.
    """
    if sweep and beside_seams(sweep):
        return [(loops[0], sites) for sites in ((AWAY,) if sweep.omits_seams else (FIRST_SITES, LAST_SITES))]
    if len(loops) == 1:
        return [(loops[0], None)]
    inside, end = loops
    return [(end, FIRST_SITES), (inside, AWAY), (end, LAST_SITES)]


def _of_equation(loops: RowLoops, kernel: Kernel, rows: Rows | None = None, end: Kernel | None = None) -> Iterator[str]:
    """Yield the text of the loops that evaluate a kernel of a stage, and of the function that calls the loops for a row
    segment.

    The kernel ``end`` updates x at the end of a stage. If it is passed, the function has the loops of both kernels, and
    its argument ``to`` selects one of them.
    """
    program, layout = loops.program, loops.layout
    adds, varied = kernel.role is Role.FOLLOW, kernel.reads_variations
    gather = layout.gathered(kernel) if kernel.inputs["gathered"] else None
    gathered = [ir.Call(ends.kernel.name, (SEGMENT,)) for ends, _ in (over_ends(gather) if gather else ())]
    kernels = [kernel, end] if end else [kernel]
    blocks = dict[str, ir.Block]()
    for form, versions in loops.forms(rows, map(loops.sites.stage, kernels)).items():
        both = list[ir.Block]()
        for one in kernels:
            parts = loops.stage(one, form, versions, adds=adds or one is end)
            yield from (printed(program, loop) for loop in parts)
            both.append(tuple(ir.Call(loop.name, (COEF, at(sites))) for loop, sites in calls_of(parts)))
        updates_state = ir.Binary("==", ir.fixed("to"), STATE)
        blocks[form] = (ir.If(updates_state, both[1], both[0]),) if end else both[0]
    setup = [row_drivers.member("x", ir.fixed("y"))]
    setup += [row_drivers.member("start", STATE)] * ("start" in kernel.inputs)
    setup += [row_drivers.member("varied", ir.fixed("v"))] * varied
    setup.append(row_drivers.member("out", ir.fixed("to")))
    updated = range(program.dimension) if kernel.role in (Role.RELAX, Role.FOLLOW) else ()
    calls = (*gathered, *row_drivers.in_forms(blocks))
    case = RowSegment(calls, tuple(setup), updated=updated, arrays=ir.fixed("to"))
    full_range = rows is not None and bool(rows.limited)
    parameters = ["coef", *["full_range"] * full_range, "y", *["v"] * varied, "to"]
    name = "stage_piece" if end else f"{kernel.name}_piece"
    yield commented(drivers(loops).driver(name, _TITLES[kernel.role], parameters, [case], alone=True), program)


_TITLES = {
    Role.RELAX: "A sweep over y, or the update of x at the end of a stage",
    Role.SLOPE: "Derivative of a sweep with respect to y, along v",
    Role.OWN_SLOPE: "Derivative of a sweep with respect to y at the site itself",
    Role.SIDE: "Derivative of a sweep with respect to x, along v",
    Role.FOLLOW: "Add to `to` the derivative of the increment of x with respect to y, along v",
}
