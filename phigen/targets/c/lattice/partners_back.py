"""The transpose of what bonds, or pairs of sites, add up at a site, as loops in C.

What sites get of the sums of others is found by each of them for itself. It goes over its bonds, once as the site
where a sum belongs, and once as the other one; over all other sites once, as both.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from phigen.lattice.pairing import HERE, THERE, paired
from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.steps import Ends
from phigen.symbolic.expression import ZERO
from phigen.targets.c.lattice.layout import Layout
from phigen.targets.c.lattice.loops import Loop, in_loops
from phigen.targets.c.lattice.names import OVER_SITES, SiteNames, told
from phigen.targets.c.lattice.partners import bonds_of
from phigen.targets.code import Store, lower

#: The bonds of a site at the other end of those that begin or end at another, and how these are chosen.
_OPPOSITE = {"": "", "a": "b", "b": "a"}
_CHOSEN = {"": "", "here": "there", "there": "here"}

#: Cotangents that all sites add up.
_SUMS = ("coef_bar", "params_bar")


def gathering_back(program: Program, layout: Layout, ends: Ends, kernel: Kernel, first: int) -> Iterator[Loop]:
    """The loops for pairs, or the ends of bonds, where the cotangents of sums are in arrays from the first on."""
    if not layout.graph:
        whole = paired(layout.step.sites.ends, ends.kernel, kernel)
        if any(not e.is_zero for e in whole.roots):
            yield _loop(program, layout, ends, whole, "a", first)
        return
    for end, turned in (("a", ends), ("b", replace(ends, end=_OPPOSITE[ends.end], chosen=_CHOSEN[ends.chosen]))):
        own = _at_end(layout, kernel, end)
        if any(not e.is_zero for e in own.roots):
            yield _loop(program, layout, turned, own, end, first)


def _at_end(layout: Layout, kernel: Kernel, end: str) -> Kernel:
    """What belongs to the site at an end; what belongs to the sum as a whole is left to its own site."""
    ends = layout.step.sites.ends
    outputs = []
    for o in kernel.outputs:
        names = kernel.inputs["site"] if o.name == "site_bar" else ()
        kept = [ends[n][1] == end for n in names] if names else [end == "a"] * len(o.values)
        values = tuple(e if keep else ZERO for e, keep in zip(o.values, kept, strict=True))
        outputs.append(replace(o, values=values))
    return replace(kernel, outputs=tuple(outputs))


def _loop(program: Program, layout: Layout, ends: Ends, kernel: Kernel, end: str, first: int) -> Loop:
    name, code = program.name, lower(kernel)
    count = len(kernel.inputs[HERE])
    seeds = {kind: [f"handed_{first + k}" for k in range(count)] for kind in (HERE, THERE)}
    names = SiteNames(program, layout, kernel, code, set(), in_loops(program), (), seeds, end)
    other, own = names.of_pair(code)
    stores = [s for s in code.stores if not s.value.is_zero]
    bars = {k: layout.bar(_array_of(layout, kernel, s)) for k, s in enumerate(stores) if s.array not in _SUMS}
    head = names.pointers()
    used = {k for kind in (HERE, THERE) for k, s in enumerate(kernel.inputs.get(kind, ())) if s in code.used}
    head += [f"const double *handed_{first + k} = row->handed[{first + k}];" for k in sorted(used)]
    head += [f"double *bar_{k} = row->bar[{k}];" for k in sorted(set(bars.values()))]
    source = "params" if "params" in kernel.inputs else "coef"
    head += ["(void)sums;"] * all(s.array != f"{source}_bar" for s in stores)
    head += ["(void)coef;"] * (source == "coef" and code.used.isdisjoint(kernel.inputs["coef"]))
    values = [f"const double {names.scope[a.target]} = {names.show(a.value)};" for a in code.assignments]
    shown = [names.show(s.value) for s in stores]
    if layout.graph:
        text = _over_bonds(layout, ends, stores, shown, bars, head, own, [*other, *values])
    else:
        text = _over_pairs(name, stores, shown, bars, head, own, other, values)
    arguments = f"{told(program, source)}, double *sums"
    if not layout.graph:
        return Loop(kernel.name, "what a site gets of cotangents of sums, its own and those of others", arguments, text)
    said = "the site where the sum is" if end == "a" else "the other site"
    return Loop(f"{kernel.name}_{end}", f"what {said} gets of cotangents of sums", arguments, text)


def _array_of(layout: Layout, kernel: Kernel, store: Store) -> str:
    if store.array == "bonds_bar":
        return kernel.inputs["bonds"][store.index]
    return layout.step.sites.ends[kernel.inputs["site"][store.index]][0]


def _over_bonds(
    layout: Layout,
    ends: Ends,
    stores: Sequence[Store],
    shown: Sequence[str],
    bars: Mapping[int, int],
    head: Sequence[str],
    own: Sequence[str],
    values: Sequence[str],
) -> str:
    """A loop over sites, in it one over their bonds."""
    loop, passed = bonds_of(ends)
    shares = [k for k, s in enumerate(stores) if s.array in _SUMS]
    sites = [k for k, s in enumerate(stores) if s.array == "site_bar"]
    inner = [*passed, "const ptrdiff_t j = row->s->other[k];" * any("[j]" in v for v in values), *values]
    for k, (store, value) in enumerate(zip(stores, shown, strict=True)):
        kept = {**dict.fromkeys(_SUMS, f"share{k}"), "site_bar": f"own{k}"}
        inner.append(f"{kept.get(store.array, f'bar_{bars.get(k)}[k]')} += {value};")
    lines = [*head, *(f"double share{k} = 0.0;" for k in shares), f"{OVER_SITES} {{"]
    lines += [f"    {line}" for line in [*own, *(f"double own{k} = 0.0;" for k in sites), loop]]
    lines += [*(f"        {line}" for line in inner if line), "    }"]
    lines += [*(f"    bar_{bars[k]}[i] += own{k};" for k in sites), "}"]
    lines += [f"sums[{stores[k].index}] += share{k};" for k in shares]
    return "".join(f"    {line}\n" for line in lines)


def _over_pairs(
    name: str,
    stores: Sequence[Store],
    shown: Sequence[str],
    bars: Mapping[int, int],
    head: Sequence[str],
    own: Sequence[str],
    other: Sequence[str],
    values: Sequence[str],
) -> str:
    """Loops over all sites for eight of a piece at a time, whose sums stay in registers.

    What a pair adds is found for all sums before any of it is added, or gcc would not vectorise the loop."""
    shares = [k for k, s in enumerate(stores) if s.array in _SUMS]
    inner = ["const ptrdiff_t i = first + l;", *own, *values]
    inner += [f"const double add{k} = i == j ? 0.0 : {value};" for k, value in enumerate(shown)]
    inner += [f"own{k}[l] += add{k};" for k in range(len(stores))]
    lines = [*head, *(f"double share{k}[8] = {{ 0.0 }};" for k in shares)]
    lines += ["for (ptrdiff_t first = row->from, to = row->to; first < to; first += 8) {"]
    lines.append(f"    double {', '.join(f'own{k}[8] = {{ 0.0 }}' for k in range(len(stores)))};")
    lines += ["    for (ptrdiff_t j = 0; j < row->s->length; ++j) {", *(f"        {line}" for line in other)]
    lines += [f"        {name}_EACH_SITE", "        for (ptrdiff_t l = 0; l < 8; ++l) {"]
    lines += [*(f"            {line}" for line in inner), "        }", "    }"]
    lines.append("    for (ptrdiff_t l = 0; l < 8 && first + l < to; ++l) { /* beyond are numbers, but no sites */")
    into = [f"share{k}[l]" if k in shares else f"bar_{bars[k]}[first + l]" for k in range(len(stores))]
    lines += [f"        {place} += own{k}[l];" for k, place in enumerate(into)]
    lines += ["    }", "}", *(f"sums[{stores[k].index}] += {name}_total(share{k});" for k in shares)]
    return "".join(f"    {line}\n" for line in lines)
