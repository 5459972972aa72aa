"""Traversal of the loop IR: the statements of a function, the values in them, and their replacement."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields, is_dataclass, replace
from typing import Any

from phigen.ir import nodes as ir
from phigen.symbolic.expression import Expression, symbols_of


def statements(body: ir.Block) -> Iterator[ir.Statement]:
    """Yield all statements, each before those inside it."""
    for s in body:
        yield s
        yield from statements(getattr(s, "body", getattr(s, "then", ())))


def map_blocks(function: ir.Function, change: Callable[[ir.Block], Iterable[ir.Statement]]) -> ir.Function:
    """Return the function with every block replaced, inner blocks first."""

    def visit(body: ir.Block) -> ir.Block:
        return tuple(change(tuple(_with_body(s, visit) for s in body)))

    return replace(function, body=visit(function.body))


def _with_body(s: ir.Statement, visit: Callable[[ir.Block], ir.Block]) -> ir.Statement:
    inner = {f.name: visit(getattr(s, f.name)) for f in fields(s) if f.name in ("body", "then")}
    return replace(s, **inner) if inner else s  # type: ignore[arg-type]


def names_in(node: Any) -> set[str]:
    """Return the names and the symbols of expressions that are read anywhere in a node."""
    if isinstance(node, Expression):
        return {*symbols_of(node)}
    if isinstance(node, tuple):
        return set().union(*map(names_in, node))
    if isinstance(node, ir.Name):
        return {node.symbol}
    return set().union(*(names_in(getattr(node, f.name)) for f in fields(node))) if is_dataclass(node) else set()
