"""The transpose of a step of a lattice in C: loops that pull cotangents back through its sweeps.

A sweep is gone back through in two goes, so that every site is written by itself alone, whatever the threads. In the
first, each site finds what it gives to the values that it has read. What is its own it adds at once; what belongs to
others it puts into arrays, one for each value that is ``handed``. In the second, each site adds what it is handed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from phigen.lattice.adjoint import BACK
from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.steps import Adjoint, Sweep, Sweeps
from phigen.symbolic.symbols import COEFFICIENT, Symbol
from phigen.targets.c.kernels import function, members
from phigen.targets.c.lattice.layout import Layout, layout_of
from phigen.targets.c.lattice.loops import Loop, forms_of, in_loops
from phigen.targets.c.lattice.names import SiteNames, beside
from phigen.targets.c.lattice.partners import gathering
from phigen.targets.c.lattice.partners_back import gathering_back
from phigen.targets.c.lattice.parts import Case, calls_over_sites, over_rows
from phigen.targets.code import Code, lower
from phigen.targets.rendering import render


@dataclass(frozen=True)
class Handed:
    """A value that a sweep hands to the site at an offset: the number of its array, and the number of that of bars."""

    array: int
    base: int
    offset: tuple[int, ...]


@dataclass(frozen=True)
class Back:
    """How a part goes back: its loops, what is called for each piece of a row in the first and in the second go, and
    how many arrays of values are handed."""

    loops: tuple[Loop, ...]
    first: tuple[str, ...]
    second: tuple[str, ...]
    handed: int


def printed(program: Program, step: Sweeps, adjoint: Adjoint) -> str:
    """The loops, and which of them go back through which part."""
    layout, kernels = layout_of(program, step), {kernel.name: kernel for kernel in adjoint.steps}
    found = [function(program, adjoint.prepare)] if adjoint.prepare.inputs["params"] else []
    found += [function(program, adjoint.refresh)] if adjoint.refresh else []
    parts = [_part(program, layout, kernels, k) for k in range(len(step.parts))]
    found += [loop.text(program) for part in parts for loop in part.loops]
    setups = [
        [*_SETUP, *["at.row.chosen = colour;"] * bool(step.by_colour and step.by_colour[k])] for k in range(len(parts))
    ]
    back = [Case(p.first, setup, _has_ends(p.first)) for p, setup in zip(parts, setups, strict=True)]
    found.append(_over(program, layout, "How a part goes back", "back_rows", dict(enumerate(back, 1))))
    where = _givers(program) if len(step.sites.axes) > 1 else []
    hand = {
        k: Case(p.second, [*setup, *where], beside=False)
        for k, (p, setup) in enumerate(zip(parts, setups, strict=True), 1)
        if p.second
    }
    found += [_over(program, layout, "What sites are handed", "hand_rows", hand)] if hand else []
    return "\n".join([_tables(program, step, parts), *found, _added(program, step, layout)])


_SETUP = ("at.row.x = x;", "at.row.bar = bar;", "at.row.handed = handed;")


def _has_ends(calls: Sequence[str]) -> bool:
    """Whether sites beside open ends have loops of their own."""
    return any("second" in call for call in calls)


def _part(program: Program, layout: Layout, kernels: Mapping[str, Kernel], number: int) -> Back:
    """The two goes of all sweeps of a part."""
    loops, first, second = list[Loop](), list[str](), list[str]()
    beside, given = list[Handed](), 0
    sums = f"sums + unit * {program.name}_COEFFICIENTS"

    def called(loop: Loop, sites: str = "at.from, at.to") -> str:
        return f"{program.name}_{loop.name}(coef, &at.row, {sites}, {sums});"

    for sweep in layout.step.parts[number]:
        kernel = kernels[sweep.kernel.name + BACK]
        listed, begin = _handed(layout, kernel, given), given
        given = max([given, *(h.array + 1 for h in listed)]) + (len(sweep.gather.names) if sweep.gather else 0)
        own = [_loop(program, layout, sweep, form, more, listed, begin) for form, more in forms_of(program, kernel)]
        first += _gathered(program, layout, sweep)
        first += [called(call.loop, call.sites) for call in calls_over_sites(own)]
        ends = sweep.gather.ends if sweep.gather else ()
        bonds = [
            loop for e in ends for loop in gathering_back(program, layout, e, kernels[e.kernel.name + BACK], begin)
        ]
        second += map(called, bonds)
        loops += [*own, *bonds]
        beside += listed
    first += _ends(program, layout, beside)
    if beside:
        loop = _handing(program, layout, number + 1, beside)
        second.append(f"{program.name}_{loop.name}(&at.row, at.from, at.to);")
        loops.append(loop)
    return Back(tuple(loops), tuple(first), tuple(second), given)


def _gathered(program: Program, layout: Layout, sweep: Sweep) -> Iterator[str]:
    """The calls of what bonds or pairs add up, of which those of equal code are one: the first."""
    names: dict[str, str] = {}
    for other in (s for part in layout.step.parts for s in part if s.gather):
        for loop in gathering(program, layout, other.gather, "coef") if other.gather else ():
            names.setdefault(loop.code, loop.name)
    for loop in gathering(program, layout, sweep.gather, "coef") if sweep.gather else ():
        yield f"{program.name}_{names[loop.code]}(coef, &at.row, at.from, at.to);"


def _over(program: Program, layout: Layout, title: str, head: str, cases: Mapping[int, Case]) -> str:
    """A function that does what is called for pieces of rows, of some parts."""
    coloured, arguments = bool(layout.step.by_colour), "double *const *x, double *const *bar, double *const *handed"
    if head == "back_rows" or layout.step.partners:
        arguments = f"const double *coef, {arguments}, double *sums"
    more = {"title": title, "head": head, "coloured": coloured}
    more["arguments"] = f"int {'flow' if coloured else 'part'}, {arguments}"
    unused = ["part"] * (len(cases) == 1 and not coloured)
    return over_rows(program, layout, list(cases.values()), list(cases), unused=unused, **more)


def _tables(program: Program, step: Sweeps, parts: Sequence[Back]) -> str:
    moved = [{f for sweep in part for f in sweep.moved} for part in step.parts]
    rows = [", ".join(str(int(f in own)) for f in range(program.dimension)) for own in moved]
    values = {
        "NAME": program.name,
        "parts": len(step.parts),
        "moves": ", ".join(f"{{ {row} }}" for row in rows),
        "hands": ", ".join(str(int(bool(part.second))) for part in parts),
        "handed": max(1, *(part.handed for part in parts)) if parts else 1,
        "bars": program.dimension + len(step.sites.parameters) + len(step.sites.at_bonds),
        "numbers": max(1, sum(p.at == "all" for p in program.parameters)),
    }
    return render("c", "lattice_adjoint.c", values)


def _handed(layout: Layout, kernel: Kernel, first: int) -> list[Handed]:
    """What a sweep hands to sites beside, in arrays from the first on: one for values that are the same."""
    arrays: dict[int, int] = {}
    found = []
    for name, value in kernel.along("site"):
        base, offset = layout.step.sites.places[name]
        if any(offset) and not value.is_zero:
            array = arrays.setdefault(id(value), first + len(arrays))
            found.append(Handed(array, layout.bar(base), offset))
    return found


def _loop(
    program: Program, layout: Layout, sweep: Sweep, kernel: Kernel, form: str, handed: Sequence[Handed], begin: int
) -> Loop:
    """The first go of a sweep; the cotangents of sums over bonds or pairs are handed in arrays from ``begin`` on."""
    name, code, step = program.name, lower(kernel), layout.step
    moved = [program.coordinates[i] for i in sweep.moved]
    seeds, sums = {"change_bar": [f"bar_{layout.bar(f)}" for f in moved]}, sweep.gather.names if sweep.gather else ()
    names = SiteNames(program, layout, kernel, code, set(), in_loops(program), sums, seeds)
    head, stores, shares = _unused(code), list[str](), list[tuple[int, str]]()
    used, given = {layout.bar(f) for f in moved}, dict[int, str]()
    places = {(h.base, h.offset): h.array for h in handed}
    for store in (s for s in code.stores if not s.value.is_zero):
        value = names.show(store.value)
        if store.array == "coef_bar":
            shares.append((store.index, value))
            continue
        if store.array == "gathered_bar":
            given[begin + sums.index(kernel.inputs["gathered"][store.index])] = value
            continue
        base, offset = step.sites.places[kernel.inputs["site"][store.index]]
        number = layout.bar(base)
        if any(offset):
            given.setdefault(places[number, offset], value)
        else:
            used.add(number)
            stores.append(f"bar_{number}[i] += {value};")
    arrays = [*(h.array for h in handed), *range(begin, begin + len(sums))]
    given |= {array: "0.0" for array in arrays if array not in given}
    stores += [f"handed_{array}[i] = {value};" for array, value in given.items()]
    head += [f"    double *restrict bar_{k} = row->bar[{k}]{layout.at(0)};" for k in sorted(used)]
    for array in given:
        head.append(f"    double *restrict handed_{array} = row->handed[{array}]{layout.at(0)};")
        if step.sites.colours > 1:
            head.append(f"    memset(handed_{array} + from, 0, (size_t)(to - from) * sizeof *handed_{array});")
    body = names.loaded()
    body += [f"const double {names.scope[a.target]} = {names.show(a.value)};" for a in code.assignments]
    body += [*stores, *(f"share{k}[i - begin] = {value};" for k, (_, value) in enumerate(shares))]
    text = _looped(name, layout, sweep, [*head, *(f"    {line}" for line in names.pointers())], body, shares)
    arguments = f"const double *coef, const {name}_row *row, ptrdiff_t from, ptrdiff_t to, double *sums"
    return Loop(kernel.name + form, kernel.purpose, arguments, text)


def _looped(
    name: str, layout: Layout, sweep: Sweep, head: Sequence[str], body: Sequence[str], shares: Sequence[tuple[int, str]]
) -> str:
    """The loop over sites; where they have shares in sums, over so many of them at once that these are kept apart."""
    coloured = layout.step.sites.colours > 1
    begin, end = ("begin", "end") if shares else ("from", "to")
    start = f"{name}_first(row, {sweep.colour}, {begin})" if coloured else begin
    onward = f"i += {layout.colour_step}" if coloured else "++i"
    loop = [f"{name}_EACH_SITE", f"for (ptrdiff_t i = {start}; i < {end}; {onward}) {{"]
    loop += [*(f"    {line}" for line in body), "}"]
    if not shares:
        return "\n".join([*head, "    (void)sums;", *(f"    {line}" for line in loop)]) + "\n"
    kept = ", ".join(f"share{k}[{name}_ADDED]" for k in range(len(shares)))
    inner = [f"const ptrdiff_t end = to - begin < {name}_ADDED ? to : begin + {name}_ADDED;"]
    if coloured:
        inner += [f"memset(share{k}, 0, sizeof share{k});" for k in range(len(shares))]
    inner += [*loop, *(f"sums[{c}] += {name}_added(share{k}, end - begin);" for k, (c, _) in enumerate(shares))]
    lines = [f"double {kept};", f"for (ptrdiff_t begin = from; begin < to; begin += {name}_ADDED) {{"]
    return "\n".join([*head, *(f"    {line}" for line in [*lines, *(f"    {line}" for line in inner), "}"])]) + "\n"


def _unused(code: Code) -> list[str]:
    return [] if any(isinstance(s, Symbol) and s.kind == COEFFICIENT for s in code.used) else ["    (void)coef;"]


def _ends(program: Program, layout: Layout, handed: Sequence[Handed]) -> Iterator[str]:
    """What copies the ends of rows of what is handed along them; beyond open ends there is nothing."""
    if layout.step.sites.open[-1]:
        return
    for array in sorted({h.array for h in handed if h.offset[-1]}):
        yield f"{program.name}_ends(handed[{array}]{layout.at(0, 'at.row.')}, s->length, at.from, at.to);"


def _handing(program: Program, layout: Layout, part: int, handed: Sequence[Handed]) -> Loop:
    """The second go of a part: a site at an offset from another is handed what that has for it."""
    sums: dict[int, list[str]] = {}
    pointers: dict[str, str] = {}
    for h in handed:
        back = tuple(-o for o in h.offset)
        line = layout.line(back)
        pointer = f"handed_{h.array}" + (f"_{line}" if line else "")
        pointers[pointer] = f"const double *restrict {pointer} = row->handed[{h.array}]{layout.at(line)};"
        sums.setdefault(h.base, []).append(beside(pointer, back[-1]))
    lines = [f"    {text}" for text in pointers.values()]
    lines += [f"    double *restrict bar_{k} = row->bar[{k}]{layout.at(0)};" for k in sums]
    lines += [f"    {program.name}_EACH_SITE", "    for (ptrdiff_t i = from; i < to; ++i) {"]
    lines += [f"        bar_{k}[i] += {' + '.join(terms)};" for k, terms in sums.items()]
    purpose = f"what sites are handed by those around that the sweeps of H_{part} have changed"
    arguments = f"const {program.name}_row *row, ptrdiff_t from, ptrdiff_t to"
    return Loop(f"hand{part}", purpose, arguments, "\n".join([*lines, "    }"]) + "\n")


def _givers(program: Program) -> list[str]:
    name = program.name
    return [
        f"{name}_find_givers(s, unit, at.givers);",
        "at.row.at = at.givers;",
    ]


def _added(program: Program, step: Sweeps, layout: Layout) -> str:
    """How the derivatives along parameters are added to those of the caller."""
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
