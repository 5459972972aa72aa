"""Printing of functions of the loop IR in JavaScript."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from phigen.ir import nodes as ir
from phigen.targets.js.printing import LANGUAGE, camel, comment, wrapped
from phigen.targets.spelling import Dialect, Spelling

DIALECT = Dialect(
    LANGUAGE,
    operators={"==": "===", "!=": "!==", "and": "&&", "or": "||"},
    functions={name: camel(name) for name in ("taylor_product", "taylor_chain", "taylor_power")},
)


def function(lowered: ir.Function, names: Iterable[str] = ()) -> str:
    """Return a function of the loop IR as JavaScript. Its identifiers differ from ``names``, the names of other
    functions in the file.
    """
    head = f"function {camel(lowered.name)}({', '.join(lowered.parameters)}) {{"
    if not lowered.body:
        return "\n".join([*comment(lowered.doc), f"{head}}}"])
    return "\n".join([*comment(lowered.doc), head, *statements(lowered, names), "}"])


def statements(lowered: ir.Function, names: Iterable[str] = ()) -> list[str]:
    """Return the lines of the body of a function. Its identifiers differ from ``names``, the names of other functions
    in the file.
    """
    spelling = Spelling(DIALECT, {*lowered.parameters, *names}, lowered.body)
    return [line for s in lowered.body for line in _statement(s, spelling, "  ")]


def _statement(s: ir.Statement, spelling: Spelling, indent: str) -> Iterator[str]:
    match s:
        case ir.Declare(in_place=True):
            spelling.substitute(s)
        case ir.Loop(_, body, variable, low, high) if low and high:
            head = f"let {variable} = {spelling(low)}; {variable} < {spelling(high)}; {variable}++"
            yield f"{indent}for ({head}) {{"
            yield from (line for inner in body for line in _statement(inner, spelling, f"{indent}  "))
            yield f"{indent}}}"
        case _:
            yield from wrapped(_line(s, spelling), indent)


def _line(s: ir.Statement, spelling: Spelling) -> str:
    match s:
        case ir.Declare(_, items):
            return f"const {', '.join(f'{spelling.name(name)} = {spelling(value)}' for name, value in items)};"
        case ir.Unpack(names, value):
            return f"const {{ {', '.join(names)} }} = {spelling(value)};"
        case ir.Assign(target, value, adds):
            return f"{spelling(target)} {'+=' if adds else '='} {spelling(value)};"
        case ir.Call(name, arguments, instance):
            owner = f"{spelling(instance)}." if instance else ""
            return f"{owner}{camel(name)}({', '.join(map(spelling, arguments))});"
        case ir.Clear(array, None, count) if count:
            return f"{spelling(array)}.fill(0, 0, {spelling(count)});"
        case ir.If(condition, (ir.Continue(),)):
            return f"if ({spelling(condition)}) continue;"
    raise TypeError(s)
