"""The transpose of what bonds, or pairs of sites, add up at a site, as loops in C.

What sites get of the sums of others is found by each of them for itself: it goes over its bonds, or over all other
sites, once, as both the site where a sum belongs and the other one. Where bonds are between sites of a colour and
others, or are not alike from both ends, it goes over them as the other one, and where need be as that of the sum.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import replace

from phigen.lattice.pairing import paired
from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.steps import Ends
from phigen.symbolic.expression import ZERO
from phigen.symbolic.symbols import HERE, THERE
from phigen.targets.c.lattice.layout import Layout
from phigen.targets.c.lattice.loops import Loop, in_loops
from phigen.targets.c.lattice.names import OVER_SITES, SiteNames, told
from phigen.targets.c.lattice.partners import bonds_of
from phigen.targets.code import Store, lower

#: The bonds of a site at the other end of those that begin or end at another, and how these are chosen.
_OPPOSITE = {"": "", "a": "b", "b": "a"}
_CHOSEN = {"": "", "here": "there", "there": "here"}

#: Sites that get at once what pairs give them.
_AT_ONCE = 32

#: Cotangents that all sites add up, and others.
_SUMS, _OF_ARRAYS = ("coef_bar", "params_bar"), ("site_bar", "bonds_bar")


def gathering_back(
    program: Program,
    layout: Layout,
    ends: Ends,
    opposite: Set[str],
    kernel: Kernel,
    first: int,
    *,
    summed: bool = False,
) -> Iterator[Loop]:
    """The loops for bonds or pairs, where the cotangents of sums are in arrays from the first on.

    Parameters at bonds that are ``opposite`` have the other sign seen from the end b. The sums themselves are found too
    if they are to be ``summed``."""
    if ends.of_all:
        whole = paired(layout.step.sites.ends, ends.kernel, kernel, opposite)
        sums = [o for o in ends.kernel.outputs if summed]
        found = [("a", ends, replace(whole, outputs=(*whole.outputs, *sums)))]
    else:
        turned = replace(ends, end=_OPPOSITE[ends.end], chosen=_CHOSEN[ends.chosen])
        found = [("b", turned, _at_end(layout, kernel, "b")), ("a", ends, _at_end(layout, kernel, "a"))]
    for end, seen, own in found:
        if any(not e.is_zero for e in own.roots):
            yield _loop(program, layout, seen, opposite, own, end, first)


def _at_end(layout: Layout, kernel: Kernel, end: str) -> Kernel:
    """What belongs to the site at an end; what belongs to bonds, or to all of them, is left to b."""
    ends = layout.step.sites.ends
    outputs = []
    for o in kernel.outputs:
        names = kernel.inputs["site"] if o.name == "site_bar" else ()
        kept = [ends[n][1] == end for n in names] if names else [end == "b"] * len(o.values)
        values = tuple(e if keep else ZERO for e, keep in zip(o.values, kept, strict=True))
        outputs.append(replace(o, values=values))
    return replace(kernel, outputs=tuple(outputs))


def _loop(
    program: Program, layout: Layout, ends: Ends, opposite: Set[str], kernel: Kernel, end: str, first: int
) -> Loop:
    name, code = program.name, lower(kernel)
    count = len(kernel.inputs[HERE])
    seeds = {kind: [f"handed_{first + k}" for k in range(count)] for kind in (HERE, THERE)}
    names = SiteNames(program, layout, kernel, code, set(), in_loops(program), (), seeds, end, opposite=opposite)
    other, own = names.of_pair(code)
    stores = [s for s in code.stores if not s.value.is_zero]
    bars = {k: layout.bar(_array_of(layout, kernel, s)) for k, s in enumerate(stores) if s.array.endswith(_OF_ARRAYS)}
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
        sides = [f"const double side = k < row->s->middle[i] ? {'1.0 : -1.0' if end == 'a' else '-1.0 : 1.0'};"]
        turned = {
            k for k, s in enumerate(stores) if s.array == "bonds_bar" and _array_of(layout, kernel, s) in opposite
        }
        shown = [f"side * ({value})" if k in turned else value for k, value in enumerate(shown)]
        other = [*sides * bool(turned or not code.used.isdisjoint(opposite)), *other]
        text = _over_bonds(layout, ends, stores, shown, bars, head, own, [*other, *values])
    else:
        text = _over_pairs(name, stores, shown, bars, head, own, other, values)
    arguments = f"{told(program, source)}, double *sums"
    if ends.of_all:
        return Loop(kernel.name, "what a site gets of cotangents of sums, its own and those of others", arguments, text)
    said = "the site where the sum is" if end == "a" else "the other site"
    return Loop(f"{kernel.name}_{end}", f"what {said} gets of cotangents of sums", arguments, text)


def _array_of(layout: Layout, kernel: Kernel, store: Store) -> str:
    if store.array == "bonds_bar":
        return kernel.inputs["bonds"][store.index]
    return layout.step.sites.ends[kernel.inputs["site"][store.index]][0]


def _into(store: Store, bar: int | None, share: str, site: str) -> str:
    """Where what bonds or pairs give to a site is added, or put."""
    if store.array == "sums":
        return f"row->s->gathered[{store.index}][{site}] ="
    return f"{share if store.array in _SUMS else f'bar_{bar}[{site}]'} +="


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
    """A loop over sites, in it one over their bonds. What these give to a sum over all is added up at each site before,
    so that few additions wait for one another."""
    loop, passed = bonds_of(ends)
    shares = [k for k, s in enumerate(stores) if s.array in _SUMS]
    summed = [k for k, s in enumerate(stores) if s.array != "bonds_bar"]
    inner = [*passed, "const ptrdiff_t j = row->s->other[k];" * any("[j]" in v for v in values), *values]
    for k, value in enumerate(shown):
        inner.append(f"{f'own{k}' if k in summed else f'bar_{bars[k]}[k]'} += {value};")
    lines = [*head, *(f"double share{k} = 0.0;" for k in shares), f"{OVER_SITES} {{"]
    lines += [f"    {line}" for line in [*own, *(f"double own{k} = 0.0;" for k in summed), loop]]
    lines += [*(f"        {line}" for line in inner if line), "    }"]
    lines += [f"    {_into(stores[k], bars.get(k), f'share{k}', 'i')} own{k};" for k in summed]
    lines += ["}", *(f"sums[{stores[k].index}] += share{k};" for k in shares)]
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
    """Loops over all sites for some of a piece at a time, as many as make additions to their sums independent.

    They are whole vectors of 8: rows have room for them. What a pair adds is found for all sums before any of it is
    added, or gcc would not vectorise the loop."""
    shares = [k for k, s in enumerate(stores) if s.array in _SUMS]
    inner = ["const ptrdiff_t i = first + l;", *own, *values]
    inner += [f"const double add{k} = i == j ? 0.0 : {value};" for k, value in enumerate(shown)]
    inner += [f"own{k}[l] += add{k};" for k in range(len(stores))]
    sums = [f"own{k}[{_AT_ONCE}]" for k in range(len(stores))]
    body = [f"const ptrdiff_t left = to - first < {_AT_ONCE} ? to - first : {_AT_ONCE}, count = (left + 7) / 8 * 8;"]
    body += [f"double {', '.join(sums)};", "for (ptrdiff_t l = 0; l < count; ++l) {"]
    body += [*(f"    own{k}[l] = 0.0;" for k in range(len(stores))), "}"]
    body += ["for (ptrdiff_t j = 0; j < row->s->length; ++j) {", *(f"    {line}" for line in other)]
    body += [f"    {name}_EACH_SITE", "    for (ptrdiff_t l = 0; l < count; ++l) {"]
    body += [*(f"        {line}" for line in inner), "    }", "}"]
    body.append("for (ptrdiff_t l = 0; l < left; ++l) { /* beyond are numbers, but no sites */")
    into = [_into(s, bars.get(k), f"share{k}", "first + l") for k, s in enumerate(stores)]
    body += [*(f"    {place} own{k}[l];" for k, place in enumerate(into)), "}"]
    lines = [*head, *(f"double share{k} = 0.0;" for k in shares)]
    lines += [f"for (ptrdiff_t first = row->from, to = row->to; first < to; first += {_AT_ONCE}) {{"]
    lines += [*(f"    {line}" for line in body), "}", *(f"sums[{stores[k].index}] += share{k};" for k in shares)]
    return "".join(f"    {line}\n" for line in lines)
