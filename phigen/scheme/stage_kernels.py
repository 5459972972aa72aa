"""Kernels for the implicit equation of a stage of a lattice: the transpose of the equation in three kernels, and the
diagonal blocks of the Newton matrix, one block for each site.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from phigen.scheme.kernel import Kernel, Output, Role
from phigen.scheme.steps import Sites, Sweeps
from phigen.symbolic.expression import ZERO, gradient

#: Name of the kernel for diagonal blocks. The kernel differentiates the right-hand side of the equation y = … at a site
#: with respect to y at the same site.
_BLOCK = "own_slope"

#: Selections of the cotangents that a transposed kernel computes, as pairs of flags. The first flag is for the
#: cotangents of fields, the second for all other cotangents.
_ALL, _FIELDS, _OTHERS = (True, True), (True, False), (False, True)

#: Transposed kernels of a stage in the order of the reverse pass, with the kernels that they transpose. The first one
#: passes the cotangent of the new state to y, the solution of the implicit equation. The second one passes the
#: cotangent of y to y at other sites, and is repeated until the transposed equation is solved. The third one passes the
#: cotangent of y to the old state x and to parameters.
KERNELS = (("advance_back", "increment", _ALL), ("slope_back", "relax", _FIELDS), ("relax_back", "relax", _OTHERS))


def restricted(sites: Sites, fields: Sequence[str], kernel: Kernel, selection: tuple[bool, bool], name: str) -> Kernel:
    """Return a transposed kernel that computes only the selected cotangents: those of fields, or those of all other
    values.

    Cotangents of sums over bonds or pairs are always computed.
    """
    of_fields, of_others = selection
    outputs = []
    for o in kernel.outputs:
        array = o.name.removesuffix("_bar")
        if array == "gathered":
            selected = [True] * len(o.values)
        elif array == "site":
            bases = [(sites.ends if "sums_bar" in kernel.inputs else sites.places)[s][0] for s in kernel.inputs["site"]]
            selected = [of_fields if base in fields else of_others for base in bases]
        else:
            selected = [of_others] * len(o.values)
        values = tuple(e if keep else ZERO for e, keep in zip(o.values, selected, strict=True))
        outputs.append(replace(o, values=values))
    return replace(kernel, name=name, outputs=tuple(outputs))


def site_block(step: Sweeps, fields: Sequence[str], relax: Kernel) -> Kernel:
    """Return the kernel of the derivatives of ``relax`` with respect to y at the same site of a lattice.

    ``relax`` is the right-hand side of the implicit equation y = … of a stage. The output is a matrix over the fields,
    row by row.
    """
    places = step.sites.places
    at_site = {places[s][0]: s for s in relax.inputs["site"] if not any(places[s][1])}
    slopes = [gradient(e, [at_site[f]])[0] if f in at_site else ZERO for e in relax.roots for f in fields]
    return replace(
        relax,
        name=_BLOCK,
        purpose="the right-hand side of y = ... at a site, differentiated with respect to y at this site",
        outputs=(Output(_BLOCK, tuple(slopes)),),
        role=Role.OWN_SLOPE,
    )
