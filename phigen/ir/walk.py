"""Traversal of the loop IR: iteration over statements and values, and their replacement."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields, is_dataclass, replace
from functools import cache
from typing import Any

from phigen.ir import nodes as ir
from phigen.symbolic.expression import Expression, symbols_of


def statements(body: ir.Block) -> Iterator[ir.Statement]:
    """Yield all statements of a block. Each statement comes before the statements inside it."""
    for s in body:
        yield s
        for inner in blocks(s):
            yield from statements(inner)


def blocks(s: ir.Statement) -> tuple[ir.Block, ...]:
    """Return the blocks inside a statement, such as the body of a loop."""
    match s:
        case ir.Loop(body=body) | ir.Within(body=body):
            return (body,)
        case ir.If(then=then, otherwise=otherwise):
            return then, otherwise
        case ir.Switch(cases=cases):
            return cases
    return ()


def map_blocks(function: ir.Function, change: Callable[[ir.Block], Iterable[ir.Statement]]) -> ir.Function:
    """Return the function with ``change`` applied to each of its blocks; inner blocks are changed first."""

    def visit(body: ir.Block) -> ir.Block:
        return tuple(change(tuple(_with_body(s, visit) for s in body)))

    return replace(function, body=visit(function.body))


def _with_body(s: ir.Statement, visit: Callable[[ir.Block], ir.Block]) -> ir.Statement:
    match s:
        case ir.Loop(body=body) | ir.Within(body=body):
            return replace(s, body=visit(body))
        case ir.If(then=then, otherwise=otherwise):
            return replace(s, then=visit(then), otherwise=visit(otherwise))
        case ir.Switch(cases=cases):
            return replace(s, cases=tuple(map(visit, cases)))
    return s


@cache
def _fields(kind: type) -> tuple[str, ...]:
    return tuple(f.name for f in fields(kind)) if is_dataclass(kind) else ()


def values(node: Any) -> Iterator[Any]:
    """Yield a node, and all statements and values inside it. Expressions are yielded as a whole."""
    rest = [node]
    while rest:
        one = rest.pop()
        if isinstance(one, tuple):
            rest += reversed(one)
        elif isinstance(one, Expression):
            yield one
        elif names := _fields(one.__class__):
            yield one
            rest += [getattr(one, name) for name in reversed(names)]


def names_in(node: Any) -> set[str]:
    """Return all names of variables and all symbols of expressions that a node reads."""
    parts = [*values(node)]
    symbols = symbols_of(*(v for v in parts if isinstance(v, Expression)))
    return {*symbols, *(v.symbol for v in parts if isinstance(v, ir.Name))}
