"""Transposed kernels of the reverse pass through a stage of the series, restricted to some of their cotangents."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from phigen.scheme.kernel import Kernel
from phigen.symbolic.expression import ZERO
from phigen.targets.c.lattice.layout import Layout

#: Whether cotangents of fields around are found, and all others.
_ALL, _FIELDS, _OTHERS = (True, True), (True, False), (False, True)

#: By which names, from which kernels, in order: what the end of a stage gives to y; what y gives to y around it, again
#: and again until the equation is solved; and then what it gives to x and to parameters.
KERNELS = (("advance_back", "increment", _ALL), ("slope_back", "relax", _FIELDS), ("relax_back", "relax", _OTHERS))


def restricted(
    layout: Layout, fields: Sequence[str], kernel: Kernel, selection: tuple[bool, bool], name: str
) -> Kernel:
    """Restrict a transposed kernel to the cotangents of fields, or to the others; those of sums are in both."""
    places, ends = layout.step.sites.places, layout.step.sites.ends
    of_fields, of_others = selection
    outputs = []
    for o in kernel.outputs:
        array = o.name.removesuffix("_bar")
        if array == "gathered":
            selected = [True] * len(o.values)
        elif array == "site":
            bases = [(ends if "sums_bar" in kernel.inputs else places)[s][0] for s in kernel.inputs["site"]]
            selected = [of_fields if base in fields else of_others for base in bases]
        else:
            selected = [of_others] * len(o.values)
        values = tuple(e if keep else ZERO for e, keep in zip(o.values, selected, strict=True))
        outputs.append(replace(o, values=values))
    return replace(kernel, name=name, outputs=tuple(outputs))
