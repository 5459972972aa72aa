"""Statements that add values up, also with compensation, or find the largest or smallest; NaN propagates."""

from __future__ import annotations

from collections.abc import Iterator

from phigen.ir import nodes as ir

#: The comparison by which a value replaces the present extreme.
_COMPARISONS = {"max": ">", "min": "<"}


def limit(extreme: str, infinity: str) -> ir.Name:
    """Return the initial value of an extreme, which every other value replaces; ``infinity`` is its name in the
    language."""
    return ir.fixed(infinity if extreme == "min" else f"-{infinity}")


def updates(s: ir.Store, place: ir.Value, value: ir.Value) -> Iterator[ir.Statement]:
    """Yield the statements that take a value into the sum, or the extreme, at a place, or that assign it."""
    if not s.extreme:
        yield ir.Assign(place, value, s.adds)
        return
    following = ir.fixed(f"next{s.array.number}")
    yield ir.real(following, value)
    beyond = ir.Binary(_COMPARISONS[s.extreme], following, place)
    no_number = ir.Binary("!=", following, following)
    yield ir.Assign(place, ir.Select(ir.Binary("or", beyond, no_number), following, place))


def compensated_sum(k: int, field: ir.Value, compensation: ir.Value, increment: ir.Value) -> Iterator[ir.Statement]:
    """Yield the statements of compensated sum number k; the rounding error goes into the compensation term."""
    add, total = ir.fixed(f"add{k}"), ir.fixed(f"sum{k}")
    items = ((add.symbol, ir.Accumulated(compensation, increment)), (total.symbol, ir.Binary("+", field, add)))
    yield ir.Declare(ir.Type.REAL, items)
    yield ir.Assign(compensation, ir.Binary("-", add, ir.Binary("-", total, field)))
    yield ir.Assign(field, total)
