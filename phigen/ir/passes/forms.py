"""Forms of elementary functions: polynomials for small arguments, full-range functions, and versions for SIMD lanes.

This pass follows `phigen.ir.passes.temporaries`. It replaces calls such as ``sin`` by ``sin_near`` or ``sin_lane``,
which the runtime of a target defines. Functions without such a version are called as before.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Set
from dataclasses import replace

from phigen.ir import nodes as ir
from phigen.ir.walk import map_blocks, values
from phigen.lanes.lane_functions import FULL_RANGE_FUNCTIONS, LANE_FORMULAS, LANE_FUNCTIONS
from phigen.symbolic.expression import Expression, fold, raw, topological
from phigen.symbolic.special import SPECIAL

#: Suffixes of the names of functions: for small arguments, for SIMD lanes, and for versions of the solver that replace
#: library functions for all arguments.
NEAR, LANE, OWN = "_near", "_lane", "_own"

#: SIMD has the versions of functions for loops over lanes. IN_LANES has those for loops over sites, where functions
#: with a removable singularity only have a small-argument form. FULL_RANGE has those of IN_LANES that are defined for
#: all arguments.
SIMD = {f: f + LANE for f in (*LANE_FUNCTIONS, *LANE_FORMULAS)}
IN_LANES = {f: version for f, version in SIMD.items() if f not in SPECIAL}
FULL_RANGE = {f: version for f, version in IN_LANES.items() if f in FULL_RANGE_FUNCTIONS}


def calling(function: ir.Function, versions: Mapping[str, str]) -> ir.Function:
    """Return the function with calls of other versions of elementary functions."""

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
    """Return the forms that some functions need, as suffix of their names → versions to call in this form.

    ``small_argument`` are the elementary functions with a small-argument version. ``limited`` are those whose fast
    versions fail at large arguments. If no ``limited`` function is called, there is one form, with the suffix "".
    """
    graphs = [v for f in functions for v in values(f.body) if isinstance(v, Expression)]
    if {e.op for e in topological(graphs)}.isdisjoint(limited):
        return {"": versions}
    near = {f: f + (LANE if f in SPECIAL else NEAR) for f in small_argument}
    return {"_near": {**versions, **near}, "_far": FULL_RANGE}
