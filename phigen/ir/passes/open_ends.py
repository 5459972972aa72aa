"""Separate loops for sites near open ends and for all other sites, where no term reaches beyond an end.

The pass applies to functions with loops over sites, before their lowering. It also comes before
`phigen.ir.passes.temporaries`, so that values are still expression graphs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from phigen.ir import nodes as ir
from phigen.ir.walk import map_blocks, statements
from phigen.symbolic.expression import ONE, Expression, substitute

#: Suffix of the names of functions that are correct near open ends.
NEAR_ENDS = "_end"


def divided_at_ends(function: ir.Function) -> list[ir.Function]:
    """Return two functions: one without weights, for sites away from open ends, and one with weights, for sites near
    open ends. The weight of a term is 0 at sites where the term reaches beyond an end, else 1.

    If the function has no weights, it alone is returned.
    """
    if not any(map(_weight, statements(function.body))):
        return [function]
    near = replace(function, name=function.name + NEAR_ENDS, doc=f"{function.doc}, for sites near open ends")
    return [map_blocks(function, _without_weights), near]


def _weight(s: ir.Statement) -> str:
    """Return the name that a statement declares, if the value is the weight of a term at open ends; "" for other
    statements.
    """
    return s.items[0][0] if isinstance(s, ir.Declare) and isinstance(s.items[0][1], ir.Inside) else ""


def _without_weights(body: ir.Block) -> Iterator[ir.Statement]:
    """Yield the statements with 1 in place of all weights. Statements that add 0 are left out, as are the declarations
    of weights.
    """
    ones = dict.fromkeys(filter(None, map(_weight, body)), ONE)
    graphs = (s.value for s in body if isinstance(s, ir.Update))
    values = iter(substitute([e for e in graphs if isinstance(e, Expression)], ones))
    for s in body:
        if isinstance(s, ir.Update):
            value = next(values)
            if not (value.is_zero and (isinstance(s, ir.Reduce) or s.adds)):
                yield replace(s, value=value)
        elif not _weight(s):
            yield s
