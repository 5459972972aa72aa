"""Functions of the loop IR in C."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from phigen.ir import nodes as ir
from phigen.targets.c.kernels import LANGUAGE
from phigen.targets.spelling import Dialect, Spelling

#: Identifiers that lowered functions use, which names of users make way for.
_RESERVED = frozenset(
    {"coef", "row", "to", "out", "apart", "i", "j", "k", "l", "side", "sums", "begin", "end", "whole", "lanes"}
    | {"at_bonds", "sign", "across", "first", "left", "count"}
)
#: Identifiers that are numbered, and used only with small numbers.
_NUMBERED = ("change", "add", "sum")

#: Functions of the runtime whose names begin with that of the solver.
_RUNTIME = ("first", "LANES", "total", "added", "ADDED")


def statements(body: ir.Block, name: str, calls: Mapping[str, str], reserved: Iterable[str] = ()) -> str:
    """Return the body of a function of a solver as text; ``calls`` are the names of elementary functions."""
    dialect = Dialect(
        replace(LANGUAGE, functions=calls),
        operators={"and": "&&", "index": "ptrdiff_t", "size": "size_t"},
        functions={function: f"{name}_{function}" for function in _RUNTIME},
        pointers=frozenset({"row", "s"}),
    )
    called = {word.strip("({") for text in calls.values() for word in text.split("(")}
    numbered = {f"{word}{k}" for word in _NUMBERED for k in range(3)}
    spelling = Spelling(dialect, _RESERVED | called | numbered | {*reserved}, body)
    return "".join(f"    {line}\n" for line in _lines(body, spelling, name))


def _lines(body: Iterable[ir.Statement], spelling: Spelling, name: str) -> Iterator[str]:
    for s in body:
        yield from _statement(s, spelling, name)


def _statement(s: ir.Statement, spelling: Spelling, name: str) -> Iterator[str]:
    match s:
        case ir.Declare(in_place=True):
            spelling.substitute(s)
        case ir.Declare():
            yield _declaration(s, spelling)
        case ir.Assign(target, value, adds, too):
            yield f"{' = '.join(map(spelling, (target, *too)))} {'+=' if adds else '='} {spelling(value)};"
        case ir.Call(function, arguments):
            yield f"{name}_{function}({', '.join(map(spelling, arguments))}){';' * (not function.isupper())}"
        case ir.Clear(array, first, count):
            start = spelling(ir.Binary("+", array, first) if first else array)
            yield f"memset({start}, 0, {spelling(ir.Cast(count, 'size'))} * sizeof *{spelling(array)});"
        case ir.Discard(parameter):
            yield f"(void){parameter};"
        case ir.If(condition, (ir.Continue(),)):
            yield f"if ({spelling(condition)}) continue;"
        case ir.Loop():
            yield from _loop(s, spelling, name)
        case _:
            raise TypeError(s)


def _declaration(s: ir.Declare, spelling: Spelling) -> str:
    star, length = "", ""
    match s.type:
        case ir.Pointer(constant, restricted):
            kind, star = f"{'const ' * constant}double", "*restrict " if restricted else "*"
        case ir.Vector(size):
            kind, length = "double", f"[{spelling(size)}]"
        case kind_of_number:
            kind = f"{'const ' * (not s.mutable)}{'double' if kind_of_number is ir.Type.REAL else 'ptrdiff_t'}"
    items = (f"{star}{spelling.name(name)}{length}{_initial(value, spelling)}" for name, value in s.items)
    return f"{kind} {', '.join(items)};{f' /* {s.note} */' if s.note else ''}"


def _initial(value: ir.Value, spelling: Spelling) -> str:
    match value:
        case ir.Constant(None):
            return ""
        case ir.Listed(values):
            return f" = {{ {', '.join(map(spelling, values))} }}"
    return f" = {spelling(value)}"


def _loop(s: ir.Loop, spelling: Spelling, name: str) -> Iterator[str]:
    assert s.low is not None
    assert s.high is not None
    limit = f", {s.limit} = {spelling(s.high)}" if s.limit else ""
    goes_on = f"{spelling(s.condition)} && " if s.condition else ""
    goes_on += f"{s.variable} < {s.limit or spelling(s.high)}"
    onward = f"{s.variable} += {spelling(s.step)}" if s.step else f"++{s.variable}"
    head = f"for (ptrdiff_t {s.variable} = {spelling(s.low)}{limit}; {goes_on}; {onward})"
    if s.independent:
        yield f"{name}_EACH_{s.independent}"
    body = [*_lines(s.body, spelling, name)]
    if s.kind == "line":
        yield f"{head} {body[0]}"
        return
    yield from (f"{head} {{{f' /* {s.note} */' if s.note else ''}", *(f"    {line}" for line in body), "}")
