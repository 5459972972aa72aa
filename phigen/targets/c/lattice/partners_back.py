"""The transpose of what bonds, or pairs of sites, add up at a site, as loops in C.

What sites get of the sums of others is found by each of them for itself: it goes over its bonds, or over all other
sites, once, as both the site where a sum belongs and the other one. Where bonds are between sites of a colour and
others, or are not alike from both ends, it goes over them as the other one, and where need be as that of the sum.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from phigen.ir import nodes as ir
from phigen.ir.passes import row_transposes
from phigen.ir.passes.forms import calling
from phigen.ir.passes.temporaries import temporaries
from phigen.scheme.kernel import Kernel
from phigen.scheme.pair_transposes import paired
from phigen.scheme.steps import Ends
from phigen.symbolic.expression import ZERO
from phigen.symbolic.symbols import HERE
from phigen.targets.c.lattice.layout import Layout
from phigen.targets.c.lattice.loops import RowLoops

#: The bonds of a site at the other end of those that begin or end at another, and how these are chosen.
_OPPOSITE = {"": "", "a": "b", "b": "a"}
_CHOSEN = {"": "", "here": "there", "there": "here"}


def gathering_back(
    loops: RowLoops, ends: Ends, opposite: frozenset[str], kernel: Kernel, first: int, *, summed: bool = False
) -> Iterator[ir.Function]:
    """The loops for bonds or pairs, where the cotangents of sums are in arrays from the first on.

    Parameters at bonds that are ``opposite`` have the other sign seen from the end b. The sums themselves are found too
    if they are to be ``summed``."""
    if ends.of_all:
        whole = paired(loops.layout.step.sites.ends, ends.kernel, kernel, opposite)
        sums = [o for o in ends.kernel.outputs if summed]
        transposes = [("a", ends, replace(whole, outputs=(*whole.outputs, *sums)))]
    else:
        turned = replace(ends, end=_OPPOSITE[ends.end], chosen=_CHOSEN[ends.chosen])
        transposes = [(end, seen, _at_end(loops.layout, kernel, end)) for end, seen in (("b", turned), ("a", ends))]
    for end, seen, transposed in transposes:
        if any(not e.is_zero for e in transposed.roots):
            yield _loop(loops, seen, opposite, transposed, end, first)


def _at_end(layout: Layout, kernel: Kernel, end: str) -> Kernel:
    """Restrict a kernel to the cotangents of the site at an end; those of bonds and shared values belong to b."""
    ends = layout.step.sites.ends
    outputs = []
    for o in kernel.outputs:
        names = kernel.inputs["site"] if o.name == "site_bar" else ()
        selected = [ends[n][1] == end for n in names] if names else [end == "b"] * len(o.values)
        values = tuple(e if keep else ZERO for e, keep in zip(o.values, selected, strict=True))
        outputs.append(replace(o, values=values))
    return replace(kernel, outputs=tuple(outputs))


def _loop(loops: RowLoops, ends: Ends, opposite: frozenset[str], kernel: Kernel, end: str, first: int) -> ir.Function:
    built = calling(temporaries(loops.sites.transposed_sums(ends, kernel)), loops.versions)
    name, purpose = kernel.name, "what a site gets of cotangents of sums, its own and those of others"
    if not ends.of_all:
        receiver = "the site where the sum is" if end == "a" else "the other site"
        name, purpose = f"{kernel.name}_{end}", f"what {receiver} gets of cotangents of sums"
    built = replace(built, name=name, doc=purpose)
    transpose = row_transposes.BondTranspose(built, end, first, len(kernel.inputs[HERE]), opposite)
    return row_transposes.transposed_sums(transpose, loops.rows)
