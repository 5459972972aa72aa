"""The loops that pull cotangents back through a kernel at sites, in two goes: see `adjoint`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.reversal import UNDONE
from phigen.symbolic.symbols import AROUND, COEFFICIENT, Symbol
from phigen.targets.c.lattice.layout import Layout, givers
from phigen.targets.c.lattice.loops import Loop
from phigen.targets.c.lattice.names import OVER_SITES, SiteNames, beside, told
from phigen.targets.code import Code, Store, lower


@dataclass(frozen=True)
class Handed:
    """A value that a kernel hands to the site at an offset: the number of its array, and the number of that of bars."""

    array: int
    base: int
    offset: tuple[int, ...]


@dataclass(frozen=True)
class Seeds:
    """Where the cotangents of what a kernel finds are read, which are symbols of a ``kind``: in arrays of cotangents by
    their numbers, ``bars``, or if these are empty in the variation that rows tell of; the ``colour`` of the sites."""

    kind: str
    pointers: tuple[str, ...]
    bars: tuple[int, ...] = ()
    colour: int | None = 0

    def read(self, code: Code) -> list[int]:
        """The numbers of those that some code reads."""
        return sorted({int(s.key[0]) for s in code.used if isinstance(s, Symbol) and s.kind == self.kind})

    def declared(self, code: Code, here: str) -> list[str]:
        """The declarations of those pointers that are not cotangents to be added to."""
        if self.bars:
            return []
        return [f"    const double *restrict {self.pointers[k]} = row->varied[{k}]{here};" for k in self.read(code)]


def handed_by(layout: Layout, kernel: Kernel, first: int) -> list[Handed]:
    """What a kernel hands to sites beside, in arrays from the first on: one for values that are the same."""
    arrays: dict[int, int] = {}
    found = []
    for name, value in kernel.along("site"):
        base, offset = layout.step.sites.places[name]
        if any(offset) and not value.is_zero:
            array = arrays.setdefault(id(value), first + len(arrays))
            found.append(Handed(array, layout.bar(base), offset))
    return found


def first_loop(
    program: Program,
    layout: Layout,
    kernel: Kernel,
    form: str,
    seeds: Seeds,
    sums: Sequence[str],
    handed: Sequence[Handed],
    begin: int,
    calls: Mapping[str, str],
    moved: Sequence[str] = (),
    taken: Sequence[Handed] = (),
) -> Loop:
    """The first go of a kernel; cotangents of ``sums`` over bonds or pairs, if it finds any, are handed in arrays from
    ``begin`` on.

    ``moved`` are the fields that it finds as they were before the sweep. What the flow after it has handed is ``taken``
    before."""
    name, code = program.name, lower(kernel)
    around = [f"row->bar[{k}]" for k in seeds.bars]
    names = SiteNames(
        program, layout, kernel, code, {*moved}, calls, sums, {seeds.kind: seeds.pointers, AROUND: around}
    )
    head, stores, shares = _unused(code), list[str](), list[tuple[int, str]]()
    used, given = {seeds.bars[k] for k in seeds.read(code) if seeds.bars}, dict[int, str]()
    places = {(h.base, h.offset): h.array for h in handed}
    for store in (s for s in code.stores if not s.value.is_zero):
        value = names.show(store.value)
        if store.array == "coef_bar":
            shares.append((store.index, value))
            continue
        if store.array == "gathered_bar":
            given[begin + sums.index(kernel.inputs["gathered"][store.index])] = value
            continue
        if store.array == UNDONE:
            stores.append(f"{names.pointer(moved[store.index], 0)}[i] = {value};")
            continue
        base, offset = _place(layout, kernel, store)
        number = layout.bar(base)
        if any(offset):
            given.setdefault(places[number, offset], value)
        else:
            used.add(number)
            stores.append(f"bar_{number}[i] += {value};")
    found = any(o.name == "gathered_bar" for o in kernel.outputs)
    arrays = [*(h.array for h in handed), *range(begin, begin + len(sums) * found)]
    given |= {array: "0.0" for array in arrays if array not in given}
    stores += [f"handed_{array}[i] = {value};" for array, value in given.items()]
    from_others, added = _added_up(layout, "given", taken)
    used |= {h.base for h in taken}
    head += seeds.declared(code, layout.at(0))
    head += [f"    double *restrict bar_{k} = row->bar[{k}]{layout.at(0)};" for k in sorted(used)]
    for array in given:
        head.append(f"    double *restrict handed_{array} = row->handed[{array}]{layout.at(0)};")
        if layout.leaves_out(seeds.colour):
            whole = f"(size_t)(row->to - row->from) * sizeof *handed_{array}"
            head.append(f"    memset(handed_{array} + row->from, 0, {whole});")
    body = [*added, *names.loaded()]
    body += [f"const double {names.scope[a.target]} = {names.show(a.value)};" for a in code.assignments]
    head += [f"    {line}" for line in [*from_others, *names.pointers()]]
    looped = _in_vectors if program.profile == "fast" and not layout.leaves_out(seeds.colour) else _looped
    text = looped(name, layout, seeds.colour, head, [*body, *stores], shares)
    return Loop(kernel.name + form, kernel.purpose, f"{told(program)}, double *sums", text)


def _looped(
    name: str,
    layout: Layout,
    colour: int | None,
    head: Sequence[str],
    body: Sequence[str],
    shares: Sequence[tuple[int, str]],
) -> str:
    """The loop over sites; where they have shares in sums, over so many of them at once that these are kept apart."""
    body = [*body, *(f"share{k}[i - begin] += {value};" for k, (_, value) in enumerate(shares))]
    coloured = layout.leaves_out(colour)
    begin, end = ("begin", "") if shares else ("row->from", ", end = row->to")
    start = f"{name}_first(row, {colour}, {begin})" if coloured else begin
    onward = f"i += {layout.colour_step}" if coloured else "++i"
    loop = [f"{name}_EACH_SITE", f"for (ptrdiff_t i = {start}{end}; i < end; {onward}) {{"]
    loop += [*(f"    {line}" for line in body), "}"]
    if not shares:
        return "\n".join([*head, "    (void)sums;", *(f"    {line}" for line in loop)]) + "\n"
    kept = ", ".join(f"share{k}[{name}_ADDED]" for k in range(len(shares)))
    inner = [f"const ptrdiff_t end = row->to - begin < {name}_ADDED ? row->to : begin + {name}_ADDED;"]
    inner += loop
    count = "row->to - row->from"
    lines = [f"const ptrdiff_t apart = {count} < {name}_ADDED ? {count} : (ptrdiff_t){name}_ADDED;", f"double {kept};"]
    lines += [f"memset(share{k}, 0, (size_t)apart * sizeof *share{k});" for k in range(len(shares))]
    lines.append(f"for (ptrdiff_t begin = row->from; begin < row->to; begin += {name}_ADDED) {{")
    lines += [*(f"    {line}" for line in inner), "}"]
    lines += [f"sums[{c}] += {name}_added(share{k}, apart);" for k, (c, _) in enumerate(shares)]
    return "\n".join([*head, *(f"    {line}" for line in lines)]) + "\n"


def _in_vectors(
    name: str,
    layout: Layout,
    colour: int | None,
    head: Sequence[str],
    body: Sequence[str],
    shares: Sequence[tuple[int, str]],
) -> str:
    """The same, where shares stay in registers: over vectors of 8 sites, then over those that are left."""
    if not shares:
        return _looped(name, layout, colour, head, body, shares)

    lines = [f"double {', '.join(f'share{k}[8] = {{ 0.0 }}' for k in range(len(shares)))};"]
    lines.append("const ptrdiff_t to = row->to, whole = to - (to - row->from) % 8;")
    lines.append(f"const ptrdiff_t lanes = {name}_LANES(whole - row->from);")
    lines += ["for (ptrdiff_t j = row->from; j < whole; j += lanes) {", f"    {name}_EACH_LANE"]
    lines += ["    for (ptrdiff_t l = 0; l < lanes; ++l) {", "        const ptrdiff_t i = j + l;"]
    lines += [f"        {line}" for line in body]
    lines += [f"        {name}_ADD(share{k}, l, {value})" for k, (_, value) in enumerate(shares)]
    lines += ["    }", "}", "for (ptrdiff_t i = whole; i < to; ++i) {", *(f"    {line}" for line in body)]
    lines += [*(f"    share{k}[0] += {value};" for k, (_, value) in enumerate(shares)), "}"]
    lines += [f"sums[{c}] += {name}_total(share{k});" for k, (c, _) in enumerate(shares)]
    return "\n".join([*head, *(f"    {line}" for line in lines)]) + "\n"


def _place(layout: Layout, kernel: Kernel, store: Store) -> tuple[str, tuple[int, ...]]:
    """The field or parameter that a cotangent is of, and the offset of its site."""
    if store.array == "start_bar":
        return str(kernel.inputs["start"][store.index].key[0]), ()  # type: ignore[attr-defined]
    return layout.step.sites.places[kernel.inputs["site"][store.index]]


def _unused(code: Code) -> list[str]:
    return [] if any(isinstance(s, Symbol) and s.kind == COEFFICIENT for s in code.used) else ["    (void)coef;"]


def copied_ends(program: Program, layout: Layout, handed: Sequence[Handed], swept: str) -> Iterator[str]:
    """What copies the ends of rows of what is handed along them, if ``swept``; beyond open ends there is nothing."""
    if layout.step.sites.open[-1]:
        return
    for array in sorted({h.array for h in handed if h.offset[-1]}):
        yield f"{program.name}_ends(row.handed[{array}]{layout.at(0, 'row.')}, s->length, {swept});"


def handing(program: Program, layout: Layout, name: str, whom: str, handed: Sequence[Handed]) -> Loop:
    """The second go of a part: a site at an offset from another is handed what that has for it."""
    pointers, added = _added_up(layout, "handed", handed)
    bars = dict.fromkeys(h.base for h in handed)
    lines = [f"    {text}" for text in pointers]
    lines += [f"    double *restrict bar_{k} = row->bar[{k}]{layout.at(0)};" for k in bars]
    lines += [f"    {program.name}_EACH_SITE", f"    {OVER_SITES} {{", *(f"        {line}" for line in added)]
    purpose = f"what sites are handed by those around that {whom}"
    return Loop(name, purpose, told(program, "params"), "\n".join([*lines, "    }"]) + "\n")


def _added_up(layout: Layout, called: str, handed: Sequence[Handed]) -> tuple[list[str], list[str]]:
    """The pointers to what sites around hand to a site, in arrays of rows that are ``called`` so, and its addition."""
    sums: dict[int, list[str]] = {}
    pointers: dict[str, str] = {}
    for h in handed:
        back = tuple(-o for o in h.offset)
        line = layout.line(back)
        pointer = f"{called}_{h.array}" + (f"_{line}" if line else "")
        place = layout.at(line)
        if called == "given" and givers(layout.step):
            place = f" + row->givers[{line}]"
        pointers[pointer] = f"const double *restrict {pointer} = row->{called}[{h.array}]{place};"
        sums.setdefault(h.base, []).append(beside(pointer, back[-1]))
    return [*pointers.values()], [f"bar_{k}[i] += {' + '.join(terms)};" for k, terms in sums.items()]
