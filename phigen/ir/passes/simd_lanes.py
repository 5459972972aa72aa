"""SIMD lanes: a straight-line function is evaluated at several points together, one point in each lane.

Each array gets an inner index over the lanes, except for arrays that all lanes share.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace

from phigen.ir import nodes as ir

LANE, DISTINCT_COEF, LANES = ir.fixed("lane"), ir.fixed("distinct_coef"), ir.fixed("LANES")


def in_lanes(
    function: ir.Function, shared: Set[str], alike: Set[str] = frozenset(), *, single: bool = False
) -> ir.Function:
    """Return the function as a loop over all lanes. With ``single``, return it for one lane, whose number is a
    parameter.

    Arrays in ``shared`` have one value for all lanes. Arrays in ``alike`` have one value for all lanes if the parameter
    ``distinct_coef`` of the function is 0, else a value for each lane.
    """

    def at_lane(value: ir.Value) -> ir.Value:
        if not isinstance(value, ir.Entry) or not isinstance(value.array, ir.Name):
            return value
        name = value.array.text
        if name in shared:
            return value
        return ir.Entry(value, ir.Binary("*", DISTINCT_COEF, LANE) if name in alike else LANE)

    def lowered(s: ir.Statement) -> ir.Statement:
        match s:
            case ir.Declare(items=items):
                return replace(s, items=tuple((name, at_lane(value)) for name, value in items))
            case ir.Assign(target=target):
                return replace(s, target=at_lane(target))
        return s

    body = tuple(map(lowered, function.body))
    if single:
        return function.with_body(*body)
    return function.with_body(ir.Loop("lanes", body, "lane", ir.Constant(0), LANES, independent="LANE"))
