"""Functions of the loop IR in JavaScript."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from phigen.ir import nodes as ir
from phigen.targets.js.printing import LANGUAGE, camel, comment, wrapped
from phigen.targets.spelling import Dialect, Spelling

#: Identifiers that lowered functions use, which names of users make way for.
_RESERVED = frozenset({"coef", "params", "start", "x", "v", "sites", "count", "near", "present", "sums", "out"})
_RESERVED |= {"i", "j", "k", "bond", "here", "there", "colour", "colours", "chosen", *(f"change{k}" for k in range(9))}
_RESERVED |= set(LANGUAGE.functions.values())

DIALECT = Dialect(LANGUAGE, operators={"==": "===", "!=": "!==", "and": "&&", "or": "||"})


def function(lowered: ir.Function, names: Iterable[str] = ()) -> str:
    """Return the text of a function on memory; ``names`` are those of other functions in the file."""
    spelling = Spelling(DIALECT, _RESERVED | {*names}, lowered.body)
    head = f"function {camel(lowered.name)}({', '.join(lowered.parameters)}) {{"
    if not lowered.body:
        return "\n".join([*comment(lowered.doc), f"{head}}}"])
    lines = [line for s in lowered.body for line in _statement(s, spelling, "  ")]
    return "\n".join([*comment(lowered.doc), head, *lines, "}"])


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
        case ir.If(condition, (ir.Continue(),)):
            return f"if ({spelling(condition)}) continue;"
    raise TypeError(s)
