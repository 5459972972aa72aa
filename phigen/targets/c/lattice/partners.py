"""What bonds, or pairs of sites, add up at a site, as loops in C."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence, Set

from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.steps import Ends, Gather
from phigen.targets.c.lattice.ends import over_ends
from phigen.targets.c.lattice.layout import Layout, chosen_ends
from phigen.targets.c.lattice.loops import Loop, in_loops, seen_calls
from phigen.targets.c.lattice.names import OVER_SITES, SiteNames, pointers, told
from phigen.targets.code import Code, lower


def partners(program: Program, layout: Layout) -> Iterator[str]:
    """What bonds or pairs add to energies, and to what moves sites, from the parameters."""
    own = layout.partners
    for gather in () if layout.sums_up else (own.field, own.energy, own.varied):
        yield from (loop.text(program) for loop in gathering(program, layout, gather, "params"))


def gathering(program: Program, layout: Layout, gather: Gather, source: str) -> Iterator[Loop]:
    """What all bonds, or pairs with other sites, add up at some sites, from ``coef`` or ``params``."""
    seen = source == "params" and gather in (layout.partners.energy, layout.partners.field)
    calls = seen_calls(program) if seen else in_loops(program)
    for number, (ends, opposite) in enumerate(over_ends(gather)):
        unused = ["(void)coef;"] * (source == "coef" and lower(ends.kernel).used.isdisjoint(ends.kernel.inputs["coef"]))
        more = told_of_bonds(program, layout, ends, opposite) if source == "coef" else {}
        if layout.graph:
            text = _over_bonds(program, layout, ends, calls, unused, more, first=number == 0, opposite=opposite)
        else:
            targets = [f"g{k}" for k in range(len(gather.names))]
            sums = pointers([("double *restrict ", f"{t} = row->s->gathered[{k}]") for k, t in enumerate(targets)])
            body = [f"{t}[i] += i == j ? 0.0 : {{{k}}};" for k, t in enumerate(targets)]
            begin = [f"{OVER_SITES} {' = '.join(f'{t}[i]' for t in targets)} = 0.0;"]
            text = _over_pairs(program, layout, ends.kernel, calls, [*unused, *sums, *begin], body)
        arguments = ", ".join([told(program, source), *(f"{kind}{name}" for name, kind in more.items())])
        yield Loop(ends.kernel.name, ends.kernel.purpose, arguments, text)


#: The bonds of a site i, by the end that it has; and which of them are passed over.
_BONDS = {"": "row->s->bonds[i]; k < row->s->bonds[i + 1]", "a": "row->s->bonds[i]; k < row->s->middle[i]",
          "b": "row->s->middle[i]; k < row->s->bonds[i + 1]"}  # fmt: skip
_PASSED = {"there": "row->s->colours[row->s->other[k]] != row->chosen"}
_TOLD = "row->s->colours[across ? row->s->other[k] : i] != row->chosen"


def bonds_of(ends: Ends, *, told: bool = False) -> tuple[str, list[str]]:
    """The loop over the bonds of a site i that are meant, and the statement that passes some of them over; it may be
    ``told`` at which of their ends there are sites of the colour that is chosen."""
    wanted = "row->s->colours[i] == row->chosen && " if ends.chosen == "here" and not told else ""
    bounds = _BONDS[ends.end].replace("; ", f"; {wanted}", 1)
    meant = _TOLD if told else _PASSED.get(ends.chosen)
    passed = [f"if ({meant}) continue;"] if meant else []
    return f"for (ptrdiff_t k = {bounds}; ++k) {{", passed


def told_of_bonds(program: Program, layout: Layout, ends: Ends, opposite: Set[str]) -> dict[str, str]:
    """What short loops over bonds are told besides, with its type, so that one is for several parts of H.

    That is where the parameters at bonds are, the sign of the direction of bonds, and whether the sites of the colour
    that is chosen lie across them.
    """
    if program.profile == "fast" or layout.step.adjoint or not layout.graph:
        return {}
    told = {"at_bonds": "double *const *", "sign": "double "} if opposite else {}
    both = ends.chosen != "" and {"here", "there"} <= chosen_ends(layout.step)
    return told | ({"across": "int "} if both else {})


def _over_bonds(
    program: Program,
    layout: Layout,
    ends: Ends,
    calls: Mapping[str, str],
    begin: Sequence[str],
    more: Collection[str],
    *,
    first: bool,
    opposite: Set[str],
) -> str:
    """A loop over sites a, in it one over the bonds that they have to sites b, of which it may be told ``more``;
    parameters that are ``opposite`` have the other sign where the site is the end of the bond."""
    code = lower(ends.kernel)
    place, one = ("at_bonds", "sign") if "sign" in more else ("row->s->at_bonds", "1.0")
    names = SiteNames(program, layout, ends.kernel, code, set(), calls, opposite=opposite, at_bonds=place)
    count = len(code.stores)
    added = [*added_up(ends, code, names, told="across" in more, one=one, opposite=opposite)]
    out = [f"row->s->gathered[{k}][i] {'' if first else '+'}= sum{k};" for k in range(count)]
    return "\n".join(
        [
            *(f"    {line}" for line in [*begin, *names.pointers()]),
            f"    {OVER_SITES} {{",
            *(f"        {line}" for line in [*names.of_pair(code)[1], sums_of(count), *added, *out]),
            "    }\n",
        ]
    )


def sums_of(count: int) -> str:
    """The declaration of what is added up at a site."""
    return f"double {', '.join(f'sum{k} = 0.0' for k in range(count))};"


def added_up(
    ends: Ends, code: Code, names: SiteNames, *, opposite: Set[str], told: bool = False, one: str = "1.0"
) -> Iterator[str]:
    """The loop over the bonds of a site i that adds up what they add there; ``one`` is the side that they are seen
    from."""
    loop, passed = bonds_of(ends, told=told)
    other = names.of_pair(code)[0]
    inner = [*passed, *["const ptrdiff_t j = row->s->other[k];"] * bool(other)]
    inner += [f"const double side = k < row->s->middle[i] ? {one} : -{one};"] * bool(opposite)
    inner += other
    inner += [f"const double {names.scope[a.target]} = {names.show(a.value)};" for a in code.assignments]
    inner += [f"sum{s.index} += {names.show(s.value)};" for s in code.stores]
    yield from (loop, *(f"    {line}" for line in inner), "}")


def _over_pairs(
    program: Program,
    layout: Layout,
    kernel: Kernel,
    calls: Mapping[str, str],
    begin: Sequence[str],
    body: Sequence[str],
) -> str:
    """A loop over all sites b, in it one over the sites a of a piece; statements with the values of the kernel."""
    name, code = program.name, lower(kernel)
    names = SiteNames(program, layout, kernel, code, set(), calls)
    other, own = names.of_pair(code)
    lines = [*own, *(f"const double {names.scope[a.target]} = {names.show(a.value)};" for a in code.assignments)]
    lines += [text.format(*(names.show(s.value) for s in code.stores)) for text in body]
    return "\n".join(
        [
            *(f"    {line}" for line in [*names.pointers(), *begin]),
            "    for (ptrdiff_t j = 0; j < row->s->length; ++j) {",
            *(f"        {line}" for line in other),
            f"        {name}_EACH_SITE",
            f"        {OVER_SITES} {{",
            *(f"            {line}" for line in lines),
            "        }",
            "    }\n",
        ]
    )
