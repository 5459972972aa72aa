"""Forms of elementary functions: polynomials for small arguments, functions for all arguments, and versions for
SIMD.

This pass follows `phigen.ir.passes.temporaries`. It replaces calls of functions that have several versions: for
instance, it replaces ``sin`` by ``sin_near`` or ``sin_lane``. The runtime of a target defines these versions.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Set
from dataclasses import replace

from phigen.ir import nodes as ir
from phigen.ir.walk import map_blocks, values
from phigen.lanes.lane_functions import FULL_RANGE_FUNCTIONS, LANE_FORMULAS, LANE_FUNCTIONS
from phigen.symbolic.expression import Expression, fold, raw, topological
from phigen.symbolic.special import SPECIAL

#: Suffixes of the names of functions. NEAR: polynomials for small arguments. LANE: versions for SIMD lanes. OWN:
#: versions for all arguments, which the solver defines in place of library functions.
NEAR, LANE, OWN = "_near", "_lane", "_own"

#: Maps from elementary functions to their vector versions. SIMD is for loops over lanes, IN_LANES for loops over sites.
#: IN_LANES omits functions with a removable singularity: the vector versions of these are correct for small arguments
#: only.
#: FULL_RANGE has the members of IN_LANES that are called for arguments of any size.
SIMD = {f: f + LANE for f in (*LANE_FUNCTIONS, *LANE_FORMULAS)}
IN_LANES = {f: version for f, version in SIMD.items() if f not in SPECIAL}
FULL_RANGE = {f: version for f, version in IN_LANES.items() if f in FULL_RANGE_FUNCTIONS}


def calling(function: ir.Function, versions: Mapping[str, str]) -> ir.Function:
    """Return the function with each elementary function in ``versions`` replaced by its version."""

    def visit(e: Expression, arguments: list[Expression]) -> Expression:
        return raw(versions.get(e.op, e.op), tuple(arguments), e.value) if arguments else e

    def changed(value: ir.Value) -> ir.Value:
        return fold([value], visit)[0] if isinstance(value, Expression) else value

    def change(body: ir.Block) -> Iterator[ir.Statement]:
        for s in body:
            if isinstance(s, ir.Update | ir.Assign):
                s = replace(s, value=changed(s.value))
            elif isinstance(s, ir.Declare):
                s = replace(s, items=tuple((name, changed(value)) for name, value in s.items))
            yield s

    return map_blocks(function, change)


def forms_of(
    functions: Iterable[ir.Function], small_argument: Iterable[str], limited: Set[str], versions: Mapping[str, str]
) -> dict[str, Mapping[str, str]]:
    """Return the forms in which ``functions`` are printed. The result maps the suffix of each form to the versions of
    elementary functions that the form calls.

    The form "_near" is for small arguments, and "_full_range" for all arguments. ``small_argument`` are the elementary
    functions with a polynomial for small arguments. ``limited`` are the elementary functions whose fast versions fail
    at large arguments. If no limited function is called, there is a single form, with the suffix "".
    """
    graphs = [v for f in functions for v in values(f.body) if isinstance(v, Expression)]
    if {e.op for e in topological(graphs)}.isdisjoint(limited):
        return {"": versions}
    near = {f: f + (LANE if f in SPECIAL else NEAR) for f in small_argument}
    return {"_near": {**versions, **near}, "_full_range": FULL_RANGE}
