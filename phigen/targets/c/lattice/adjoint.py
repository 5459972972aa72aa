"""The transpose of a step of a lattice in C: loops that propagate cotangents backwards through its sweeps.

The reverse pass of a sweep has two traversals of the sites. A site writes only its own elements, so that any number of
threads can work on a traversal. In the first traversal, each site computes its contributions to the cotangents of all
values that it has read. It adds contributions to its own cotangents, and stores contributions to other sites in arrays,
called ``handed``. In the second traversal, each site adds the contributions that other sites have stored for it. On
grids, the second traversal can be merged with the first traversal of the next flow of the reverse pass; see
`phigen.scheme.sweep_facts.takes`. Kernels of a stage have two traversals as well; see `stage_kernels`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from phigen.ir import nodes as ir
from phigen.ir.lattice_parameters import sums_of_derivatives
from phigen.ir.passes import row_transposes
from phigen.ir.passes.by_rows import ROW
from phigen.ir.passes.row_transposes import Handed, Transpose
from phigen.ir.row_drivers import (
    BEGIN,
    COEF,
    FLOW,
    SEGMENT,
    STOP,
    UNIT,
    RowDrivers,
    RowSegment,
    S,
    Sites,
    at,
    divides,
    in_forms,
    member,
)
from phigen.lanes.in_lanes import Rows
from phigen.scheme.bond_ends import over_ends
from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.stage_kernels import KERNELS, restricted
from phigen.scheme.steps import BACK, Adjoint, Ends, Gather, Sweep, Sweeps
from phigen.scheme.sweep_facts import (
    beside_seams,
    first_kind,
    givers,
    handed_apart,
    reads_sums,
    starts_are_read,
    takes,
    ways,
)
from phigen.scheme.sweep_inverse import apart, can_recompute_fields, transposes
from phigen.symbolic.expression import symbols_of
from phigen.symbolic.symbols import AROUND, Symbol
from phigen.targets.c.kernels import function
from phigen.targets.c.language import members
from phigen.targets.c.lattice.layout import Layout, layout_of
from phigen.targets.c.lattice.loops import RowLoops, code
from phigen.targets.c.lattice.loops import printed as loop_text
from phigen.targets.c.lattice.sweep_functions import calls_of, drivers
from phigen.targets.c.loops import commented
from phigen.targets.c.real import rendered


@dataclass(frozen=True)
class Back:
    """The reverse pass of a part of H, or of a kernel of a stage: its ``loops``, and the calls for a row segment.

    ``first`` and ``second`` are the calls in the two traversals of the sites. ``handed`` is the number of arrays in
    which sites store contributions to other sites. ``recomputed`` are the fields that the inverse flow recomputes.
    """

    loops: tuple[ir.Function, ...]
    first: ir.Block
    second: ir.Block
    handed: int
    recomputed: tuple[int, ...] = ()


@dataclass(frozen=True)
class _Pulled:
    """A transposed kernel of a ``sweep`` or of a stage, and the arrays of its cotangents.

    The kernel reads the cotangents of the outputs of the original kernel, as symbols of the kind ``seed``. These
    cotangents are in the arrays with the numbers ``bars``. If ``bars`` is empty, they are in the arrays ``varied`` in
    the record of a row segment. ``gather`` has the sums that the kernel reads. ``ends`` has three items for each loop
    that computes these sums: the bonds or pairs with their kernel, the parameters that change sign at the end b of a
    bond, and the transpose of the kernel. ``before`` are statements that stand before the calls of the transposed
    kernel.

    The fields ``recomputed`` are recomputed by the kernel or, if ``undo`` is set, by the kernel ``undo``. The kernel
    ``undo`` reads sums that the transposes over bonds or pairs compute. ``taken`` are contributions of the previous
    flow of the reverse pass, which the transposed kernel adds to the cotangents.
    """

    kernel: Kernel
    seed: str
    gather: Gather | None
    ends: tuple[tuple[Ends, frozenset[str], Kernel], ...]
    before: ir.Block = ()
    bars: tuple[int, ...] = ()
    recomputed: tuple[int, ...] = ()
    undo: Kernel | None = None
    taken: tuple[Handed, ...] = ()
    sweep: Sweep | None = None


def printed(program: Program, step: Sweeps, adjoint: Adjoint, rows: Rows) -> str:
    """Return the text of the reverse pass: loops, and functions that run the loops for a part of H or for a kernel of a
    stage.
    """
    layout, kernels = layout_of(program, step), {kernel.name: kernel for kernel in adjoint.steps}
    texts = [function(program, adjoint.prepare)] if adjoint.prepare.inputs["params"] else []
    texts += [function(program, adjoint.refresh)] if adjoint.refresh else []
    reverse = _Reverse(layout, rows, kernels)
    parts = [*(reverse.of_equation() if step.equation else reverse.of_parts())]
    loops = {loop.name: loop for part in parts for loop in part.loops}
    texts += [loop_text(program, loop) for loop in loops.values()]
    texts += reverse.drivers(parts)
    return "\n".join(
        [_tables(program, step, parts, adjoint.steps), *texts, _parameter_functions(program, step, layout)]
    )


def handed_by(layout: Layout, kernel: Kernel, first: int) -> list[Handed]:
    """Return the contributions of a kernel to cotangents at neighbours, in arrays with numbers from ``first`` on.

    Contributions with equal values share an array.
    """
    arrays: dict[int, int] = {}
    contributions = []
    for name, value in kernel.along("site"):
        base, offset = layout.step.sites.places[name]
        if any(offset) and not value.is_zero:
            array = arrays.setdefault(id(value), first + len(arrays))
            contributions.append(Handed(array, layout.bar(base), offset))
    return contributions


_ARRAYS = {name: member(name, ir.fixed(name)) for name in ("x", "bar", "handed", "received")}


@dataclass(frozen=True)
class _Reverse(RowLoops):
    """Builder of the reverse pass of one lattice; ``kernels`` are the transposed kernels by name."""

    rows: Rows
    kernels: Mapping[str, Kernel]

    @property
    def row_drivers(self) -> RowDrivers:
        """The builder of the functions that call loops for the row segments of a lattice."""
        return drivers(self)

    def drivers(self, parts: Sequence[Back]) -> Iterator[str]:
        """Yield the text of two C functions, one for each traversal of the sites in the reverse pass. The functions
        call the loops for all row segments.
        """
        step = self.layout.step
        receives = takes(self.program, step)
        find_givers: ir.Block = ()
        if givers(step):
            givers_of_row = ir.Member(ROW, "givers")
            find_givers = (ir.Call("find_givers", (S, UNIT, givers_of_row)), member("at", givers_of_row))
        first, second = dict[int, RowSegment](), dict[int, RowSegment]()
        for k, part in enumerate(parts, 1):
            setup: ir.Block = (_ARRAYS["x"], _ARRAYS["bar"], _ARRAYS["handed"])
            if step.equation:
                y = ir.entry(ir.Member(S, "y"), 2)
                setup = (member("x", y), _ARRAYS["bar"], member("handed", ir.Member(S, "handed")))
            in_first: ir.Block = (member("varied", ir.fixed("v")),) if step.equation else ()
            if receives:
                in_first = (_ARRAYS["received"], *find_givers[:1])
            elif step.by_colour and step.by_colour[k - 1]:
                setup = (*setup, member("chosen", FLOW))
            first[k] = RowSegment(part.first, (*setup, *in_first), updated=part.recomputed, arrays=ir.fixed("x"))
            if part.second:
                second[k] = RowSegment(part.second, (*setup, *find_givers))
        title = "Reverse pass of a kernel" if step.equation else "Reverse pass of a part of H"
        yield self._driver(title, "back_rows", first)
        if receives:
            second = dict([*second.items()][:1])
        if second:
            yield self._driver(
                "Add the contributions of other sites to the cotangents of each site", "hand_rows", second
            )

    def _driver(self, title: str, name: str, cases: Mapping[int, RowSegment]) -> str:
        """Return the C function that runs one traversal of the sites for a part of H or for a kernel. ``cases`` has the
        statements, by the number of the part or kernel.
        """
        step, back = self.layout.step, name == "back_rows"
        full_range = ["coef", *["full_range"] * bool(self.rows.limited)]
        arrays = ["x", "bar", "handed", *["received"] * (back and takes(self.program, step))]
        parameters = [*full_range, *arrays, "sums"] if back or step.partners else arrays
        if step.equation:
            parameters = [*full_range, "v", "bar", "sums"] if back else ["bar", *["numbers"] * bool(step.partners)]
        parameters.insert(0, "flow" if step.by_colour else "part")
        build = self.row_drivers
        return commented(build.driver(name, title, parameters, [*cases.values()], [*cases], vectors=True), self.program)

    def of_parts(self) -> Iterator[Back]:
        """Yield, for each part of H, the calls of its transposed sweeps in the two traversals of the sites.

        The head of the module explains the two traversals. The second is left out if it is merged with the first
        traversal of the next flow.
        """
        program, layout, step = self.program, self.layout, self.layout.step
        recomputed, back = can_recompute_fields(program, step), transposes(program, step)
        around = {
            layout.bar(program.coordinates[sweep.moved[int(s.key[0])]])
            for part, part_kernels in zip(step.parts, back, strict=True)
            for sweep, kernel in zip(part, part_kernels, strict=True)
            for s in kernel.inputs.get(AROUND, ())
            if isinstance(s, Symbol)
        }
        taking, alone = takes(program, step), [(k, k) for k in range(len(back))]
        for k, after in dict.fromkeys(ways(step)) if taking else alone:
            pulled = list[_Pulled]()
            received = tuple(h for kernel in back[after] for h in handed_by(layout, kernel, 0)) if taking else ()
            for sweep, kernel in zip(step.parts[k], back[k], strict=True):
                bars = tuple(layout.bar(program.coordinates[i]) for i in sweep.moved)
                ends = tuple(self._ends_back(sweep.gather))
                moved = sweep.moved if recomputed else ()
                alike = len(ends) == 1 and ends[0][0].of_all
                transposed, undo = (alike and apart(kernel)) or (kernel, None)
                before = tuple(self._gathered(sweep)) if reads_sums(transposed) else ()
                kind = first_kind(step.sites, sweep)
                before += (member("window", ir.Constant(float(kind))),) if kind is not None else ()
                if received:
                    transposed = replace(transposed, name=f"{transposed.name}_after{after + 1}")
                seed, gather = "change_bar", sweep.gather
                pulled.append(_Pulled(transposed, seed, gather, ends, before, bars, moved, undo, received, sweep))
            origin = f"the sweeps of H_{k + 1} have changed"
            both = self._transpose_traversals(
                f"hand{k + 1}", origin, pulled, separate_loop=handed_apart(program, step)[k]
            )
            along = [pair for kernel in back[k] for pair in kernel.along("site")]
            written = {layout.bar(step.sites.places[s][0]) for s, e in along if not e.is_zero}
            copied = [
                self.row_drivers.copied_ends(ir.Member(ROW, "bar"), bar)
                for bar in sorted(around & written)
                if layout.halo
            ]
            second = (*both.second, *copied) if both.second else ()
            yield replace(both, first=(*both.first, *copied), second=second)

    def of_equation(self) -> Iterator[Back]:
        """Yield the loops and calls for each transposed kernel of a stage.

        The sites are traversed twice for each kernel (see the head of the module). For the first kernel, the first
        traversal also computes the sums over bonds or pairs.
        """
        layout, fields, gather = self.layout, self.program.coordinates, self.layout.partners.field
        transposed = [
            restricted(layout.step.sites, fields, self.kernels[of + BACK], outputs, name)
            for name, of, outputs in KERNELS
        ]
        summed = any(map(reads_sums, transposed))
        for number, (kernel, (name, _, outputs)) in enumerate(zip(transposed, KERNELS, strict=True)):
            seed = next(array for array in kernel.inputs if array.endswith("_bar"))
            read = gather if kernel.inputs["gathered"] else None
            ends = tuple(
                (e, opposite, restricted(layout.step.sites, fields, back, outputs, f"{e.kernel.name}_{name}"))
                for e, opposite, back in self._ends_back(read)
            )
            before = tuple(ir.Call(e.kernel.name, (SEGMENT,)) for e, _ in over_ends(gather))
            pulled = _Pulled(kernel, seed, read, ends, before if summed and number == 0 else ())
            yield self._transpose_traversals(name.replace("_back", "_hand"), f"{name} has read", [pulled])

    def _transpose_traversals(
        self, name: str, origin: str, pulled: Sequence[_Pulled], *, separate_loop: bool = True
    ) -> Back:
        """Return the loops of transposed kernels, and their calls for a row segment in the two traversals of the sites
        (see the head of this file).

        The first traversal stores contributions to the cotangents of other sites. If ``separate_loop`` is true, the
        second traversal has a loop that adds these contributions, and ``name`` is the name of this loop. Otherwise the
        next flow of the reverse pass adds the contributions. The text ``origin`` says which neighbours have
        contributed; it becomes a part of the comment on the loop.
        """
        layout, loops = self.layout, list[ir.Function]()
        first, second = list[ir.Statement](), list[ir.Statement]()
        beside, arrays = list[Handed](), 0

        def called(loop: ir.Function, sites: Sites = None) -> ir.Call:
            coefficients = "coef" in loop.parameters
            sums = ir.fixed("sums" if coefficients else "numbers")
            of_segment = ir.Binary("+", sums, ir.Binary("*", UNIT, ir.fixed("SUMS")))
            return ir.Call(loop.name, (*[COEF] * coefficients, at(sites), of_segment))

        def over_sites(one: _Pulled, kernel: Kernel, listed: Sequence[Handed], recomputed: Sequence[str]) -> ir.Block:
            """Return the calls of a transposed kernel for a row segment.

            The kernel may call functions such as sin that have two versions: one for small and one for all arguments.
            Then there are two calls of the kernel, one for each version.
            """
            sums, blocks = one.gather.names if one.gather else (), dict[str, ir.Block]()
            on_sites = self.sites.transposed(kernel, one.gather, one.sweep, recomputed)
            summed = len(sums) * any(o.name == "gathered_bar" for o in kernel.outputs)
            build = Transpose(
                on_sites, one.seed, one.bars, tuple(listed), arrays, summed, one.taken, frozenset(recomputed)
            )
            for form, versions in self.forms(self.rows, [on_sites]).items():
                of_form = (replace(build, function=f) for f in self.after_passes(on_sites, form, versions))
                parts = [row_transposes.transposed(f, layout, vectors=self.fast) for f in of_form]
                blocks[form] = tuple(called(loop, sites) for loop, sites in calls_of(parts, one.sweep))
                loops.extend(parts)
            return in_forms(blocks)

        for one in pulled:
            listed = handed_by(layout, one.kernel, arrays)
            arrays = max([arrays, *(h.array + 1 for h in listed)])
            fields = [self.program.coordinates[f] for f in one.recomputed]
            first += [*one.before, *(self._cleared(listed) if one.sweep and beside_seams(one.sweep) else ())]
            first += over_sites(one, one.kernel, listed, () if one.undo else fields)
            bonds = [loop for e in one.ends for loop in self.transposed_sums(*e, arrays, summed=bool(one.undo))]
            loops += bonds
            second += map(called, bonds)
            second += over_sites(one, one.undo, (), fields) if one.undo else ()
            arrays += len(one.gather.names) if one.gather else 0
            beside += listed
        near_ends = divides(tuple(first))
        for array in sorted({h.array for h in beside if h.offset[-1]}) if not layout.step.sites.open_axes[-1] else ():
            first.append(self.row_drivers.copied_ends(_HANDED, array, near_ends=near_ends))
        if beside and separate_loop:
            purpose = f"contributions to cotangents by the neighbours that {origin}"
            loops.append(row_transposes.handing(name, purpose, beside, self.layout))
            second.append(ir.Call(name, (SEGMENT,)))
        recomputed = sorted({f for one in pulled for f in one.recomputed})
        return Back(tuple(loops), tuple(first), tuple(second), arrays, tuple(recomputed))

    def _cleared(self, handed: Sequence[Handed]) -> Iterator[ir.Statement]:
        """Yield the statements that clear the arrays of contributions to other sites.

        The arrays must be cleared if loops omit some of the sites.
        """
        for array in sorted({h.array for h in handed}):
            row = self.row_drivers.first_of_row(_HANDED, array)
            yield ir.Clear(row, BEGIN, ir.Binary("-", STOP, BEGIN))

    def _ends_back(self, gather: Gather | None) -> Iterator[tuple[Ends, frozenset[str], Kernel]]:
        """Yield the loops over bonds or pairs that compute the sums of a gather (see `over_ends`), each with its
        transpose.
        """
        for (ends, opposite), first in zip(over_ends(gather), gather.ends, strict=False) if gather else ():
            yield ends, opposite, replace(self.kernels[first.kernel.name + BACK], name=ends.kernel.name + BACK)

    def _gathered(self, sweep: Sweep) -> Iterator[ir.Statement]:
        """Yield the calls of the loops over bonds or pairs that compute sums for a sweep.

        If several loops have equal code, the first of them is called.
        """
        names = dict[object, str]()
        for other in (s for part in self.layout.step.parts for s in part):
            for loop in self.sums(other.gather, swept=True):
                names.setdefault(code(loop), loop.name)
        for loop in self.sums(sweep.gather, swept=True):
            yield ir.Call(names[code(loop)], (COEF, SEGMENT))


_HANDED = ir.Member(ROW, "handed")


def _tables(program: Program, step: Sweeps, parts: Sequence[Back], kernels: Iterable[Kernel]) -> str:
    read = _values_read(step, kernels)
    stored = [{f for sweep in part for f in sweep.moved if program.coordinates[f] in read} for part in step.parts]
    rows = [", ".join(str(int(f in fields)) for f in range(program.dimension)) for fields in stored]
    ways_of = ways(step) if takes(program, step) else []
    values = {
        "NAME": program.name,
        "parts": len(parts),
        "kernels": [f"{name.upper()} = {k}" for k, (name, *_) in enumerate(KERNELS, 1)] if step.equation else (),
        "stored_states": 1 + starts_are_read(step),
        "sums": _sums(program, step),
        "stored_fields": "" if can_recompute_fields(program, step) else ", ".join(f"{{ {row} }}" for row in rows),
        "hands": ", ".join(str(int(bool(part.second))) for part in parts),
        "handing": not ways_of and (any(handed_apart(program, step)) or can_recompute_fields(program, step)),
        "handed": max(1, *(part.handed for part in parts)) * (2 if ways_of else 1) if parts else 1,
        "ways": ", ".join(str(1 + [*dict.fromkeys(ways_of)].index(way)) for way in ways_of),
        "bars": program.dimension + len(step.sites.parameters) + len(step.sites.at_bonds),
        "numbers": max(1, sum(p.at == "all" for p in program.parameters)),
    }
    return rendered(program, "lattice_adjoint.c", values)


def _values_read(step: Sweeps, kernels: Iterable[Kernel]) -> set[str]:
    """Return the names of the fields and parameters that transposed kernels read. The kernels read the values
    before the sweep.
    """
    used = {s for kernel in kernels for s in {*kernel.inputs.get("site", ())} & {*symbols_of(*kernel.roots)}}
    return {(step.sites.ends.get(s) or step.sites.places[s])[0] for s in used}


def _sums(program: Program, step: Sweeps) -> str:
    """Return the number of sums over sites that each row segment stores, as text in C."""
    if step.equation and step.partners:
        return f"(int){program.name}_COEFFICIENTS + {program.name}_NUMBERS"
    return f"{program.name}_COEFFICIENTS"


def _parameter_functions(program: Program, step: Sweeps, layout: Layout) -> str:
    """Return the text of the functions that add derivatives with respect to parameters to the arrays of the caller."""
    bars = {p: layout.bar(p) for p in (*step.sites.parameters, *step.sites.at_bonds)}
    added = sums_of_derivatives(program.parameters, members(program), bars)
    return "\n".join(commented(one, program) for one in added)
