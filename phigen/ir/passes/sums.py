"""Statements that compute sums, compensated sums, maxima and minima. A NaN among the values makes the result NaN."""

from __future__ import annotations

from collections.abc import Iterator

from phigen.ir import nodes as ir

#: Operator that compares a value with the current maximum or minimum.
_COMPARISONS = {"max": ">", "min": "<"}


def limit(extreme: str, infinity: str) -> ir.Name:
    """Return the initial value of a maximum, −∞, or of a minimum, ∞; ``infinity`` is the name of ∞ in the language."""
    return ir.fixed(infinity if extreme == "min" else f"-{infinity}")


def updates(s: ir.Store, place: ir.Value, value: ir.Value) -> Iterator[ir.Statement]:
    """Yield the statements by which a store changes a place: addition, maximum or minimum, or assignment."""
    if not s.extreme:
        yield ir.Assign(place, value, s.adds)
        return
    following = ir.fixed(f"next{s.array.number}")
    yield ir.real(following, value)
    beyond = ir.Binary(_COMPARISONS[s.extreme], following, place)
    no_number = ir.Binary("!=", following, following)
    yield ir.Assign(place, ir.Select(ir.Binary("or", beyond, no_number), following, place))


def compensated_sum(k: int, field: ir.Value, compensation: ir.Value, increment: ir.Value) -> Iterator[ir.Statement]:
    """Yield the statements of compensated sum ``k``, which adds the increment to the field.

    The rounding error of the addition is stored in the compensation term, and added with the next increment.
    """
    add, total = ir.fixed(f"add{k}"), ir.fixed(f"sum{k}")
    items = ((add.symbol, ir.Accumulated(compensation, increment)), (total.symbol, ir.Binary("+", field, add)))
    yield ir.Declare(ir.Type.REAL, items)
    yield ir.Assign(compensation, ir.Binary("-", add, ir.Binary("-", total, field)))
    yield ir.Assign(field, total)
