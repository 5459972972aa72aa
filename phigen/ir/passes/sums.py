"""Statements for sums, compensated sums, and the largest or smallest of several values, in which NaN propagates."""

from __future__ import annotations

from collections.abc import Iterator

from phigen.ir import nodes as ir

#: Operator by which a value is compared with the current extreme.
_COMPARISONS = {"max": ">", "min": "<"}


def limit(extreme: str, infinity: str) -> ir.Name:
    """Return the initial value of an extreme, ∞ or −∞; ``infinity`` is the name of ∞ in the language."""
    return ir.fixed(infinity if extreme == "min" else f"-{infinity}")


def updates(s: ir.Store, place: ir.Value, value: ir.Value) -> Iterator[ir.Statement]:
    """Yield the statements by which a store updates a place: sum, extreme, or assignment."""
    if not s.extreme:
        yield ir.Assign(place, value, s.adds)
        return
    following = ir.fixed(f"next{s.array.number}")
    yield ir.real(following, value)
    beyond = ir.Binary(_COMPARISONS[s.extreme], following, place)
    no_number = ir.Binary("!=", following, following)
    yield ir.Assign(place, ir.Select(ir.Binary("or", beyond, no_number), following, place))


def compensated_sum(k: int, field: ir.Value, compensation: ir.Value, increment: ir.Value) -> Iterator[ir.Statement]:
    """Yield the statements of compensated sum ``k``: the field gets the increment, and the compensation term the
    rounding error."""
    add, total = ir.fixed(f"add{k}"), ir.fixed(f"sum{k}")
    items = ((add.symbol, ir.Accumulated(compensation, increment)), (total.symbol, ir.Binary("+", field, add)))
    yield ir.Declare(ir.Type.REAL, items)
    yield ir.Assign(compensation, ir.Binary("-", add, ir.Binary("-", total, field)))
    yield ir.Assign(field, total)
