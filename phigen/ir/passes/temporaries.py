"""Temporaries: expression graphs are converted to statements.

Integer powers become products. Values that are used several times, and parts of long expressions, get variables.
Declarations of unread values are removed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from phigen.ir import nodes as ir
from phigen.ir.walk import map_blocks, names_in, statements
from phigen.scheme.lowering import assign, expand_powers
from phigen.symbolic.expression import Expression


def temporaries(function: ir.Function) -> ir.Function:
    """Return the function with variables for shared values and for parts of long expressions. Declarations of unread
    values are removed.
    """
    function = map_blocks(function, _named)
    read = names_in(tuple(s.value for s in statements(function.body) if isinstance(s, ir.Update)))

    def without_unread(body: ir.Block) -> Iterator[ir.Statement]:
        read_statements = []
        for s in reversed(body):
            if not isinstance(s, ir.Declare) or any(name in read for name, _ in s.items):
                read.update(names_in(s))
                read_statements.append(s)
        return reversed(read_statements)

    return map_blocks(function, without_unread)


def _named(body: ir.Block) -> Iterator[ir.Statement]:
    stores = [s for s in body if isinstance(s, ir.Update)]
    assignments, trees = assign(expand_powers([s.value for s in stores if isinstance(s.value, Expression)]))
    yield from (s for s in body if not isinstance(s, ir.Update))
    yield from (ir.real(a.target, a.value) for a in assignments)
    yield from (replace(s, value=tree) for s, tree in zip(stores, trees, strict=True))
