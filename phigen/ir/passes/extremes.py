"""Statements that compute the largest or smallest of several values; NaN propagates."""

from __future__ import annotations

from collections.abc import Iterator

from phigen.ir import nodes as ir

#: The comparison by which a value replaces the present extreme.
_COMPARISONS = {"max": ">", "min": "<"}


def limit(extreme: str, infinity: str) -> ir.Name:
    """Return the initial value of an extreme, which every other value replaces; ``infinity`` is its name in the
    language."""
    return ir.fixed(infinity if extreme == "min" else f"-{infinity}")


def keep(extreme: str, place: ir.Value, value: ir.Value, number: int) -> Iterator[ir.Statement]:
    """Yield the statements that replace the value at a place by a larger or smaller one, and declare a name."""
    following = ir.fixed(f"next{number}")
    yield ir.real(following, value)
    beyond = ir.Binary(_COMPARISONS[extreme], following, place)
    no_number = ir.Binary("!=", following, following)
    yield ir.Assign(place, ir.Select(ir.Binary("or", beyond, no_number), following, place))
