"""Forms of elementary functions: small-argument polynomials with a full-range fallback, and versions for SIMD lanes.

Applied after `phigen.ir.passes.temporaries`: a call of ``sin`` becomes one of ``sin_near`` or ``sin_lane``, which the
runtime of a target defines. Without a version a call remains one of the library or of the general definition.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Set
from dataclasses import replace

from phigen.ir import nodes as ir
from phigen.ir.walk import map_blocks, values
from phigen.lanes.lane_functions import FULL_RANGE_FUNCTIONS, LANE_FORMULAS, LANE_FUNCTIONS
from phigen.symbolic.expression import Expression, fold, raw, topological
from phigen.symbolic.special import SPECIAL

#: The ends of the names of functions for small arguments, of those for SIMD lanes, and of functions of a solver that
#: replace those of the library for any argument.
NEAR, LANE, OWN = "_near", "_lane", "_own"

#: Versions of functions in loops over lanes; versions in loops over sites, where functions with a removable singularity
#: have a small-argument form only; and those of the latter that are defined for all arguments.
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
    """Return the forms that some functions need together, as suffixes of their names, with the versions to call.

    ``small_argument`` are the elementary functions that have a small-argument version. Functions that call no
    ``limited`` ones (undefined at large arguments) need one form, without a suffix.
    """
    graphs = [v for f in functions for v in values(f.body) if isinstance(v, Expression)]
    if {e.op for e in topological(graphs)}.isdisjoint(limited):
        return {"": versions}
    near = {f: f + (LANE if f in SPECIAL else NEAR) for f in small_argument}
    return {"_near": {**versions, **near}, "_far": FULL_RANGE}
