"""What a stage of the series is gone back through by: the transposes of its kernels, in the shares that are needed."""

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


def restricted(layout: Layout, fields: Sequence[str], kernel: Kernel, wanted: tuple[bool, bool], name: str) -> Kernel:
    """A transposed kernel that finds the cotangents of fields only, or of all else; those of sums serve both."""
    places, ends = layout.step.sites.places, layout.step.sites.ends
    of_fields, of_others = wanted
    outputs = []
    for o in kernel.outputs:
        array = o.name.removesuffix("_bar")
        if array == "gathered":
            kept = [True] * len(o.values)
        elif array == "site":
            bases = [(ends if "sums_bar" in kernel.inputs else places)[s][0] for s in kernel.inputs["site"]]
            kept = [of_fields if base in fields else of_others for base in bases]
        else:
            kept = [of_others] * len(o.values)
        values = tuple(e if keep else ZERO for e, keep in zip(o.values, kept, strict=True))
        outputs.append(replace(o, values=values))
    return replace(kernel, name=name, outputs=tuple(outputs))
