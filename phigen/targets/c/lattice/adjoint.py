"""The transpose of a step of a lattice in C: loops that pull cotangents back through its sweeps.

A sweep is gone back through in two goes, so that every site is written by itself alone, whatever the threads. In the
first, each site finds what it gives to the values that it has read. What is its own it adds at once; what belongs to
others it puts into arrays, one for each value that is ``handed``. In the second, each site adds what it is handed. On
grids the second go is made by the same loops as the first one of the flow before, see `layout.takes`.
So it is with the kernels of the equation of a stage, see `adjoint_stages`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace

from phigen.ir.passes.row_transposes import Handed
from phigen.lanes.in_lanes import Rows
from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.steps import BACK, Adjoint, Ends, Gather, Sweep, Sweeps
from phigen.scheme.sweep_inverse import apart, can_recompute_fields, transposes
from phigen.symbolic.expression import symbols_of
from phigen.symbolic.symbols import AROUND, Symbol
from phigen.targets.c.kernels import function, members
from phigen.targets.c.lattice.adjoint_loops import Seeds, copied_ends, first_loop, handed_by, handing
from phigen.targets.c.lattice.adjoint_stages import KERNELS, restricted
from phigen.targets.c.lattice.ends import over_ends
from phigen.targets.c.lattice.layout import Layout, givers, handed_apart, layout_of, starts_are_read, takes, ways
from phigen.targets.c.lattice.loops import Loop, forms_of
from phigen.targets.c.lattice.partners import gathering
from phigen.targets.c.lattice.partners_back import gathering_back
from phigen.targets.c.lattice.parts import (
    Case,
    at,
    beside_seams,
    call_forms,
    calls_over_sites,
    either,
    first_kind,
    over_rows,
)
from phigen.targets.rendering import render


@dataclass(frozen=True)
class Back:
    """The reverse pass of a part, or of a kernel: its ``loops``, and the calls for each row segment in two traversals.

    ``handed`` is the number of arrays that sites pass to other sites, ``undone`` has the fields that the inverse flow
    recomputes.
    """

    loops: tuple[Loop, ...]
    first: tuple[str, ...]
    second: tuple[str, ...]
    handed: int
    undone: tuple[int, ...] = ()


@dataclass(frozen=True)
class _Pulled:
    """A transposed kernel, where its cotangents are, what is gathered for it, and the transposes of the kernels of
    that, with the parameters that are opposite seen from b; what is called before it, for pieces of rows; the fields
    that it undoes, or another kernel, from sums that bonds or pairs add up in their transposes; what the flow after it
    has handed, where it takes that; its ``sites`` of a piece, if it is made near seams, or away from them."""

    kernel: Kernel
    seeds: Seeds
    gather: Gather | None
    ends: tuple[tuple[Ends, Set[str], Kernel], ...]
    before: tuple[str, ...] = ()
    undone: tuple[int, ...] = ()
    undo: Kernel | None = None
    taken: tuple[Handed, ...] = ()
    sites: tuple[str, ...] = ()


def printed(program: Program, step: Sweeps, adjoint: Adjoint, rows: Rows) -> str:
    """The loops, and which of them go back through which part, or kernel of the equation of a stage."""
    layout, kernels = layout_of(program, step), {kernel.name: kernel for kernel in adjoint.steps}
    texts = [function(program, adjoint.prepare)] if adjoint.prepare.inputs["params"] else []
    texts += [function(program, adjoint.refresh)] if adjoint.refresh else []
    if step.equation:
        parts = [*_of_equation(program, layout, rows, kernels)]
        setups: list[tuple[str, ...]] = [_SETUP_OF_STAGES] * len(parts)
    else:
        parts = [*_of_parts(program, layout, rows, kernels)]
        chosen = [bool(step.by_colour and step.by_colour[k]) for k in range(len(step.parts))]
        setups = [(*_SETUP, *["row.chosen = colour;"] * is_chosen) for is_chosen in chosen]
        if takes(program, step):
            find = _givers(program)[:1] if givers(step) else []
            setups = [(*_SETUP, *_SETUP_OF_TAKING, *find)] * len(parts)
    loops = {loop.name: loop for part in parts for loop in part.loops}
    texts += [loop.text(program) for loop in loops.values()]
    back = [
        Case(p.first, setup, _has_ends(p.first), moved=p.undone, where="x")
        for p, setup in zip(parts, setups, strict=True)
    ]
    title = "How a kernel goes back" if step.equation else "How a part goes back"
    far = bool(rows.limited)
    texts.append(_over(program, layout, title, "back_rows", dict(enumerate(back, 1)), far=far))
    where = _givers(program) if givers(step) else []
    left_out = {_VARIED, *_SETUP_OF_TAKING, *where}
    hand = {
        k: Case(p.second, [*(line for line in setup if line not in left_out), *where], beside=False)
        for k, (p, setup) in enumerate(zip(parts, setups, strict=True), 1)
        if p.second
    }
    if takes(program, step):
        hand = dict([*hand.items()][:1])
    texts += [_over(program, layout, "What sites are handed", "hand_rows", hand, far=far)] if hand else []
    return "\n".join([_tables(program, step, parts, adjoint.steps), *texts, _added(program, step, layout)])


_SETUP = ("row.x = x;", "row.bar = bar;", "row.handed = handed;")
_SETUP_OF_TAKING = ("row.given = given;",)
_VARIED = "row.varied = v;"
_SETUP_OF_STAGES = ("row.x = s->y[2];", _VARIED, "row.bar = bar;", "row.handed = s->handed;")


def _has_ends(calls: Sequence[str]) -> bool:
    """Whether sites beside open ends have loops of their own."""
    return any("second" in call for call in calls)


def _of_parts(program: Program, layout: Layout, rows: Rows, kernels: Mapping[str, Kernel]) -> Iterator[Back]:
    """The two goes of all sweeps of each part, or the one of those that take what the flow after them has handed."""
    undone, back = can_recompute_fields(program, layout.step), transposes(program, layout.step)
    around = {
        layout.bar(program.coordinates[sweep.moved[int(s.key[0])]])
        for part, part_kernels in zip(layout.step.parts, back, strict=True)
        for sweep, kernel in zip(part, part_kernels, strict=True)
        for s in kernel.inputs.get(AROUND, ())
        if isinstance(s, Symbol)
    }
    taking, alone = takes(program, layout.step), [(k, k) for k in range(len(back))]
    for k, after in dict.fromkeys(ways(layout.step)) if taking else alone:
        pulled = list[_Pulled]()
        received = tuple(h for kernel in back[after] for h in handed_by(layout, kernel, 0)) if taking else ()
        for sweep, kernel in zip(layout.step.parts[k], back[k], strict=True):
            bars = tuple(layout.bar(program.coordinates[i]) for i in sweep.moved)
            seeds = Seeds("change_bar", bars, sweep.colour)
            ends = tuple(_ends_back(sweep.gather, kernels))
            moved = sweep.moved if undone else ()
            alike = len(ends) == 1 and ends[0][0].of_all
            transposed, undo = (alike and apart(kernel)) or (kernel, None)
            before = tuple(_gathered(program, layout, sweep)) if _reads_sums(transposed) else ()
            before += (f"row.window = {first_kind(layout, sweep)}.0;",) if sweep.window is not None else ()
            if received:
                transposed = replace(transposed, name=f"{transposed.name}_after{after + 1}")
            sites = beside_seams(sweep)
            pulled.append(_Pulled(transposed, seeds, sweep.gather, ends, before, moved, undo, received, sites))
        origin = f"the sweeps of H_{k + 1} have changed"
        both = _back(program, layout, rows, f"hand{k + 1}", origin, pulled, apart=handed_apart(program, layout.step)[k])
        along = [pair for kernel in back[k] for pair in kernel.along("site")]
        written = {layout.bar(layout.step.sites.places[s][0]) for s, e in along if not e.is_zero}
        place = f"{layout.at(0, 'row.')}, s->length, {layout.swept()}"
        copied = tuple(f"{program.name}_ends(row.bar[{k}]{place});" for k in sorted(around & written) if layout.halo)
        yield replace(both, first=both.first + copied, second=both.second and both.second + copied)


def _of_equation(program: Program, layout: Layout, rows: Rows, kernels: Mapping[str, Kernel]) -> Iterator[Back]:
    """The two goes of each kernel that a stage is gone back through by; in the first one what is gathered is found."""
    fields, gather = program.coordinates, layout.partners.field
    transposed = [restricted(layout, fields, kernels[of + BACK], outputs, name) for name, of, outputs in KERNELS]
    summed = any(map(_reads_sums, transposed))
    for number, (kernel, (name, _, outputs)) in enumerate(zip(transposed, KERNELS, strict=True)):
        seed = next(array for array in kernel.inputs if array.endswith("_bar"))
        seeds = Seeds(seed)
        read = gather if kernel.inputs["gathered"] else None
        ends = tuple(
            (e, opposite, restricted(layout, fields, back, outputs, f"{e.kernel.name}_{name}"))
            for e, opposite, back in _ends_back(read, kernels)
        )
        before = (f"{program.name}_{e.kernel.name}(&row);" for e, _ in over_ends(gather))
        pulled = _Pulled(kernel, seeds, read, ends, tuple(before) if summed and number == 0 else ())
        yield _back(program, layout, rows, name.replace("_back", "_hand"), f"{name} has read", [pulled])


def _back(
    program: Program,
    layout: Layout,
    rows: Rows,
    name: str,
    whom: str,
    pulled: Sequence[_Pulled],
    *,
    apart: bool = True,
) -> Back:
    """The two goes of some kernels, of which the second is ``name``, where it is ``apart`` from the next first one."""
    loops, first, second = list[Loop](), list[str](), list[str]()
    beside, arrays = list[Handed](), 0

    def called(loop: Loop, sites: str = "") -> str:
        source, sums = ("coef, ", "sums") if "*coef" in loop.arguments else ("", "numbers")
        return f"{program.name}_{loop.name}({source}{at(program, sites)}, {sums} + unit * {program.name}_SUMS);"

    def over_sites(one: _Pulled, kernel: Kernel, listed: Sequence[Handed], moved: Sequence[str]) -> list[str]:
        """The calls of a kernel, in each form, whose loops are listed."""
        lines, sums = {}, one.gather.names if one.gather else ()
        for far, calls in call_forms(program, rows, [kernel]).items():
            forms = [
                first_loop(program, layout, k, form + far, one.seeds, sums, listed, arrays, calls, moved, one.taken)
                for k, form in forms_of(program, kernel)
            ]
            whole = [(call.loop, call.sites) for call in calls_over_sites(forms)]
            lines[far] = [called(*call) for call in [(forms[0], sites) for sites in one.sites] or whole]
            loops.extend(forms)
        return either(lines)

    for one in pulled:
        listed = handed_by(layout, one.kernel, arrays)
        arrays = max([arrays, *(h.array + 1 for h in listed)])
        fields = [program.coordinates[f] for f in one.undone]
        first += [*one.before, *(_cleared(layout, listed) if one.sites else ())]
        first += over_sites(one, one.kernel, listed, () if one.undo else fields)
        bonds = [loop for e in one.ends for loop in gathering_back(program, layout, *e, arrays, summed=bool(one.undo))]
        loops += bonds
        second += map(called, bonds)
        second += over_sites(one, one.undo, (), fields) if one.undo else []
        arrays += len(one.gather.names) if one.gather else 0
        beside += listed
    swept = layout.swept("begin, stop" if _has_ends(first) else "row.from, row.to")
    first += copied_ends(program, layout, beside, swept)
    if beside and apart:
        loop = handing(program, layout, name, whom, beside)
        second.append(f"{program.name}_{loop.name}(&row);")
        loops.append(loop)
    undone = sorted({f for one in pulled for f in one.undone})
    return Back(tuple(loops), tuple(first), tuple(second), arrays, tuple(undone))


def _cleared(layout: Layout, handed: Sequence[Handed]) -> Iterator[str]:
    """Set the arrays that sites pass to others to zero where loops leave these sites out."""
    for array in sorted({h.array for h in handed}):
        place = f"row.handed[{array}]{layout.at(0, 'row.')} + begin"
        yield f"memset({place}, 0, (size_t)(stop - begin) * sizeof **row.handed);"


def _ends_back(gather: Gather | None, kernels: Mapping[str, Kernel]) -> Iterator[tuple[Ends, Set[str], Kernel]]:
    """The loops of what bonds or pairs add up, see `over_ends`, and their transposes."""
    for (ends, opposite), first in zip(
        over_ends(gather) if gather else (), gather.ends if gather else (), strict=False
    ):
        yield ends, opposite, replace(kernels[first.kernel.name + BACK], name=ends.kernel.name + BACK)


def _reads_sums(kernel: Kernel) -> bool:
    """Whether a kernel reads what bonds or pairs add up, and not only their cotangents."""
    return not set(kernel.inputs["gathered"]).isdisjoint(symbols_of(*kernel.roots))


def _gathered(program: Program, layout: Layout, sweep: Sweep) -> Iterator[str]:
    """The calls of what bonds or pairs add up, of which those of equal code are one: the first."""
    names: dict[str, str] = {}
    for other in (s for part in layout.step.parts for s in part if s.gather):
        for loop in gathering(program, layout, other.gather, "coef") if other.gather else ():
            names.setdefault(loop.code, loop.name)
    for loop in gathering(program, layout, sweep.gather, "coef") if sweep.gather else ():
        yield f"{program.name}_{names[loop.code]}(coef, &row);"


def _over(
    program: Program, layout: Layout, title: str, head: str, cases: Mapping[int, Case], *, far: bool = False
) -> str:
    """A function that does what is called for pieces of rows, of some parts."""
    coloured, whole = bool(layout.step.by_colour), head == "back_rows" or layout.step.partners is not None
    arguments = "double *const *x, double *const *bar, double *const *handed"
    if layout.step.equation:
        numbers = ["double *numbers"] * bool(layout.step.partners)
        arguments = ", ".join(["double *const *bar", *numbers])
        if head == "back_rows":
            arguments = f"const double *coef, {'int far, ' * far}double *const *v, double *const *bar, double *sums"
    elif whole:
        received = ", double *const *given" * (takes(program, layout.step) and head == "back_rows")
        arguments = f"const double *coef, {'int far, ' * far}{arguments}{received}, double *sums"
    arguments = f"int {'flow' if coloured else 'part'}, {arguments}"
    unused = ["part"] * (len(cases) == 1 and not coloured)
    calls = [call for case in cases.values() for call in case.calls]
    unused += ["numbers"] * ("*numbers" in arguments and not any("numbers" in call for call in calls))
    unused += ["far"] * ("int far" in arguments and not any("(far)" in call for call in calls))
    return over_rows(
        program,
        layout,
        list(cases.values()),
        list(cases),
        title=title,
        head=head,
        arguments=arguments,
        coloured=coloured,
        unused=unused,
        back=True,
    )


def _tables(program: Program, step: Sweeps, parts: Sequence[Back], kernels: Iterable[Kernel]) -> str:
    read = _read(step, kernels)
    stored = [{f for sweep in part for f in sweep.moved if program.coordinates[f] in read} for part in step.parts]
    rows = [", ".join(str(int(f in fields)) for f in range(program.dimension)) for fields in stored]
    ways_of = ways(step) if takes(program, step) else []
    values = {
        "NAME": program.name,
        "parts": len(parts),
        "kernels": [f"{name.upper()} = {k}" for k, (name, *_) in enumerate(KERNELS, 1)] if step.equation else (),
        "kept": 1 + starts_are_read(step),
        "sums": _sums(program, step),
        "keeps": "" if can_recompute_fields(program, step) else ", ".join(f"{{ {row} }}" for row in rows),
        "hands": ", ".join(str(int(bool(part.second))) for part in parts),
        "handing": not ways_of and (any(handed_apart(program, step)) or can_recompute_fields(program, step)),
        "handed": max(1, *(part.handed for part in parts)) * (2 if ways_of else 1) if parts else 1,
        "ways": ", ".join(str(1 + [*dict.fromkeys(ways_of)].index(way)) for way in ways_of),
        "bars": program.dimension + len(step.sites.parameters) + len(step.sites.at_bonds),
        "numbers": max(1, sum(p.at == "all" for p in program.parameters)),
    }
    return render("c", "lattice_adjoint.c", values)


def _read(step: Sweeps, kernels: Iterable[Kernel]) -> set[str]:
    """The fields, and parameters, whose values before a sweep some transposed kernel reads."""
    used = {s for kernel in kernels for s in {*kernel.inputs.get("site", ())} & {*symbols_of(*kernel.roots)}}
    return {(step.sites.ends.get(s) or step.sites.places[s])[0] for s in used}


def _sums(program: Program, step: Sweeps) -> str:
    """The number of sums of each row segment, in C."""
    if step.equation and step.partners:
        return f"(int){program.name}_COEFFICIENTS + {program.name}_NUMBERS"
    return f"{program.name}_COEFFICIENTS"


def _givers(program: Program) -> list[str]:
    name = program.name
    return [
        f"{name}_find_givers(s, unit, row.givers);",
        "row.at = row.givers;",
    ]


def _added(program: Program, step: Sweeps, layout: Layout) -> str:
    """The function that adds the derivatives along parameters to those of the caller."""
    member = members(program)
    numbers = [(member[p.name], place) for place, p in enumerate(p for p in program.parameters if p.at == "all")]
    sites = [(member[p], layout.bar(p)) for p in step.sites.parameters]
    bonds = [(member[p], layout.bar(p)) for p in step.sites.at_bonds]
    values = {
        "NAME": program.name,
        "numbers": numbers,
        "sites": sites,
        "bonds": bonds,
        "numbers_only": not (sites or bonds),
    }
    return render("c", "lattice_bars.c", values)
