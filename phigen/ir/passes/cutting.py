"""Division of long straight-line functions into parts: compile time is quadratic in the length of a function.

First, each store is moved to the earliest possible place. Then the statements are divided into parts. A temporary that
one part computes and a later part reads becomes an entry of a workspace array.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from phigen.ir import nodes as ir
from phigen.ir.passes.output_order import is_temporary
from phigen.ir.walk import names_in, values
from phigen.symbolic.expression import Expression, fold, raw, symbol, topological
from phigen.symbolic.symbols import WORK, Symbol

WORKSPACE = ir.fixed("work")


def cut(function: ir.Function, size: int) -> list[ir.Function]:
    """Return the function of a kernel as parts of at most ``size`` statements.

    Statements that clear arrays are left out; the caller of the parts clears the arrays.
    """
    statements = [s for s in function.body if is_temporary(s) or isinstance(s, ir.Assign)]
    if len(statements) <= size:
        return [function]
    ordered = _stores_early(statements)
    chunks = [ordered[i : i + size] for i in range(0, len(ordered), size)]
    home = {name: k for k, chunk in enumerate(chunks) for name in _declared(chunk)}
    crossing: dict[str, Symbol] = {}
    for k, chunk in enumerate(chunks):
        for name in _symbols(chunk):
            if home.get(name, k) != k:
                crossing.setdefault(name, Symbol(WORK, len(crossing)))
    reads = [s for s in function.body if isinstance(s, ir.Declare) and not is_temporary(s)]
    return [function.with_body(*_part(reads, chunk, crossing)) for chunk in chunks]


def workspace(parts: Sequence[ir.Function]) -> int:
    """Return the length of the workspace array that the parts of a function need."""
    entries = (s.target for part in parts for s in part.body if isinstance(s, ir.Assign))
    used = [e.index for e in entries if isinstance(e, ir.Entry) and e.array == WORKSPACE]
    return 1 + max((i.value for i in used if isinstance(i, ir.Constant) and isinstance(i.value, int)), default=0)


def _stores_early(statements: Sequence[ir.Statement]) -> list[ir.Statement]:
    """Return the statements in an order in which each store comes right after the last temporary that it reads."""
    temporaries = [s for s in statements if is_temporary(s)]
    position = {name: k for k, s in enumerate(temporaries) for name in _declared([s])}
    ready: dict[int, list[ir.Statement]] = {}
    for s in statements:
        if not is_temporary(s):
            ready.setdefault(max((position.get(n, 0) for n in _symbols([s])), default=0), []).append(s)
    if not temporaries:
        return [*statements]
    return [one for k, s in enumerate(temporaries) for one in (s, *ready.get(k, []))]


def _part(
    reads: Sequence[ir.Statement], chunk: Sequence[ir.Statement], crossing: dict[str, Symbol]
) -> list[ir.Statement]:
    """Return the body of one part of the divided function.

    ``chunk`` has the statements that belong to the part. ``crossing`` has an entry of the workspace array for each
    temporary that several parts use.
    """

    def visit(e: Expression, arguments: list[Expression]) -> Expression:
        if e.op == "symbol":
            return symbol(crossing.get(e.value, e.value))
        return raw(e.op, tuple(arguments), e.value) if e.args else e

    body = list[ir.Statement]()
    for s in sorted(chunk, key=lambda s: not is_temporary(s)):
        match s:
            case ir.Declare(items=((name, Expression() as e),)):
                (value,) = fold([e], visit)
                body.append(ir.Assign(_entry(crossing[name]), value) if name in crossing else ir.real(name, value))
            case ir.Assign(value=Expression() as e):
                body.append(replace(s, value=fold([e], visit)[0]))
    used = names_in(tuple(body))
    from_workspace = [ir.in_place(work, _entry(work)) for work in crossing.values() if work in used]
    return [*(s for s in reads if not used.isdisjoint(_declared([s]))), *from_workspace, *body]


def _entry(work: Symbol) -> ir.Entry:
    return ir.entry(WORKSPACE, int(work.key[0]))


def _declared(statements: Sequence[ir.Statement]) -> list[str]:
    return [s.items[0][0] for s in statements if isinstance(s, ir.Declare)]


def _symbols(statements: Sequence[ir.Statement]) -> list[str]:
    """Return the symbols that occur in statements, in the order of their first use."""
    graphs = [v for v in values(tuple(statements)) if isinstance(v, Expression)]
    return [e.value for e in topological(graphs) if e.op == "symbol"]
