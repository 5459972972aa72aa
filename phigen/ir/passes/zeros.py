"""Zeros among the outputs of a kernel: an array with many zeros is cleared by one statement, or zeros are not
stored.
"""

from __future__ import annotations

from collections import Counter

from phigen.ir import nodes as ir
from phigen.symbolic.expression import Expression

#: Least number of zeros for which an array is cleared by one statement, in place of separate stores.
MANY_ZEROS = 6


def zeros_first(function: ir.Function) -> ir.Function:
    """Return the function with statements that clear the arrays with many zeros.

    An array is cleared before the first store to it. The stores of zeros in the array are removed.
    """
    zeros = Counter(stored_array(s) for s in function.body if _is_zero(s))
    sizes = Counter(stored_array(s) for s in function.body)
    cleared = {array for array, count in zeros.items() if count >= MANY_ZEROS}
    body, done = list[ir.Statement](), set[str]()
    for s in function.body:
        array = stored_array(s)
        if array in cleared and array not in done:
            done.add(array)
            body.append(ir.Clear(ir.fixed(array), None, ir.Constant(sizes[array])))
        if not (array in cleared and _is_zero(s)):
            body.append(s)
    return function.with_body(*body)


def without_zeros(function: ir.Function) -> ir.Function:
    """Return the function without stores of zeros."""
    return function.with_body(*(s for s in function.body if not _is_zero(s)))


def stored_array(s: ir.Statement) -> str:
    """Return the name of the array that a statement stores to or clears; "" for other statements."""
    place = s.target if isinstance(s, ir.Assign) else s if isinstance(s, ir.Clear) else None
    array = place.array if isinstance(place, ir.Entry | ir.Clear) else None
    return array.text if isinstance(array, ir.Name) else ""


def _is_zero(s: ir.Statement) -> bool:
    return isinstance(s, ir.Assign) and isinstance(s.value, Expression) and s.value.is_zero
