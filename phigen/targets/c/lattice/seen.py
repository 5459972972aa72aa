"""What is seen at sites, the energy, Casimirs and the right-hand side, as loops in C."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.scheme.steps import Gather
from phigen.targets.c.lattice.ends import over_ends
from phigen.targets.c.lattice.layout import Layout
from phigen.targets.c.lattice.loops import looped, seen_calls
from phigen.targets.c.lattice.names import OVER_SITES, SiteNames
from phigen.targets.c.lattice.partners import added_up, sums_of
from phigen.targets.c.layout import comment
from phigen.targets.code import Code, lower
from phigen.targets.header import plain, sentence


def seen_loop(program: Program, layout: Layout, kernel: Kernel) -> str:
    """A kernel as a loop that fills arrays over the sites.

    What bonds or pairs add is found before, or where nothing else needs it at each site.
    """
    name, code, partners = program.name, lower(kernel), layout.partners
    gather = {"energy": partners.energy, "vector_field": partners.field}.get(kernel.name, Gather((), ()))
    head = comment(f"/* {plain(sentence(kernel.purpose + ', at the sites of a row'))} */")
    head.append(f"static void {name}_{kernel.name}_row(const {name}_row *row, double *restrict out)\n{{")
    apart = ["    const ptrdiff_t apart = (ptrdiff_t)row->s->sites;"] * (len(code.stores) > 1)
    if gather.ends and layout.sums_up:
        return "\n".join([*head, *apart, *_with_bonds(program, layout, kernel, code, gather), "}\n"])
    names = SiteNames(program, layout, kernel, code, set(), seen_calls(program), partners.field.names)
    early = [f"    {name}_{own.kernel.name}(row);" for own, _ in over_ends(gather)]
    body = [*names.loaded(), *_found(kernel, code, names, "row->s->gathered[0][i]" if early else "")]
    return looped([*head, *early, *apart], names, body, name) + "}\n"


def _found(kernel: Kernel, code: Code, names: SiteNames, shared: str) -> list[str]:
    """The statements that find the values of a kernel; of an energy that is ``shared`` a site has a half."""
    half = f" + 0.5 * {shared}" * bool(kernel.name == "energy" and shared)
    found = [f"const double {names.scope[a.target]} = {names.show(a.value)};" for a in code.assignments]
    for s in code.stores:
        place = f"{s.index} * apart + ".removeprefix("1 * ") * (s.index > 0)
        found.append(f"out[{place}i - row->from] = {f'{names.show(s.value)}{half}'.removeprefix('0.0 + ')};")
    return found


def _with_bonds(program: Program, layout: Layout, kernel: Kernel, code: Code, gather: Gather) -> list[str]:
    """The loop over sites of a kernel, in which what bonds add is found too."""
    ends = over_ends(gather)
    codes = {own.kernel.name: lower(own.kernel) for own, _ in ends}
    every = replace(kernel, inputs=_all_inputs([kernel.inputs, *(own.kernel.inputs for own, _ in ends)]))
    used = replace(code, used=code.used.union(*(c.used for c in codes.values())))
    opposite = frozenset[str]().union(*(turned for _, turned in ends))
    calls, sums = seen_calls(program), gather.names
    names = SiteNames(program, layout, every, used, set(), calls, sums, opposite=opposite, inside=True)
    body = [*names.loaded(), sums_of(len(sums))]
    for own, turned in ends:
        body += added_up(own, codes[own.kernel.name], names, opposite=turned)
    body += _found(kernel, code, names, "sum0")
    lines = [*names.pointers(), f"{OVER_SITES} {{", *(f"    {line}" for line in body), "}"]
    return [f"    {line}" for line in lines]


def _all_inputs(inputs: Sequence[Mapping[str, tuple[str, ...]]]) -> dict[str, tuple[str, ...]]:
    """The inputs of several kernels, as of one."""
    keys = dict.fromkeys(key for own in inputs for key in own)
    return {key: tuple(dict.fromkeys(s for own in inputs for s in own.get(key, ()))) for key in keys}
