"""Order of the statements in the function of a kernel: first named values, then for each output its temporaries and
stores.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from phigen.ir import nodes as ir
from phigen.ir.passes.zeros import stored_array
from phigen.ir.walk import names_in
from phigen.symbolic.expression import Expression


def in_output_order(function: ir.Function, named: Sequence[str], *, by_output: bool) -> ir.Function:
    """Return the function with its statements ordered by the outputs that they compute.

    First come ``named`` values, which are the momenta. With ``by_output``, the temporaries of an output and then its
    stores follow, output by output. Otherwise the stores of all outputs come last.
    """
    temporaries = {s.items[0][0]: s for s in function.body if isinstance(s, ir.Declare) and is_temporary(s)}
    stores: dict[str, list[ir.Statement]] = {}
    for s in function.body:
        if array := stored_array(s):
            stores.setdefault(array, []).append(s)
    left = dict(temporaries)

    def taken(names: Iterable[str]) -> list[ir.Statement]:
        """Return the temporaries that the values ``names`` need, in order. Remove them from ``left``, which has the
        temporaries that are not placed yet.
        """
        needed, rest = set[str](), [*names]
        while rest:
            name = rest.pop()
            if name in temporaries and name not in needed:
                needed.add(name)
                rest += names_in(temporaries[name])
        return [left.pop(name) for name in temporaries if name in needed and name in left]

    momenta = taken(named)
    groups = [(taken(names_in(tuple(of))), of) for of in stores.values()]
    reads = [s for s in function.body if isinstance(s, ir.Declare) and not is_temporary(s)]
    if not by_output:
        values = (s for declared, _ in groups for s in declared)
        return function.with_body(*reads, *momenta, *values, *(s for _, of in groups for s in of))
    return function.with_body(*reads, *momenta, *(s for declared, of in groups for s in (*declared, *of)))


def is_temporary(s: ir.Statement) -> bool:
    """Whether a statement declares a value that the kernel computes, not an input."""
    return isinstance(s, ir.Declare) and not s.in_place and isinstance(s.items[0][1], Expression)
