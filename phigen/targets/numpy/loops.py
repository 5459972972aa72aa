"""Functions of the loop IR in NumPy, on whole arrays."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from phigen.ir import nodes as ir
from phigen.targets.numpy.language import LANGUAGE
from phigen.targets.spelling import Dialect, Spelling

DIALECT = Dialect(
    LANGUAGE,
    operators={"not": "not "},
    functions={f"taylor_{kind}": f"_{kind}" for kind in ("product", "chain", "power")},
    select="np.where({0}, {1}, {2})",
)


def function(lowered: ir.Function) -> str:
    """Return the text of a function on whole arrays."""
    _, lines = statements(lowered, lowered.parameters)
    return "\n".join([f"def _{lowered.name}({', '.join(lowered.parameters)}):", *lines, ""])


def statements(lowered: ir.Function, reserved: Iterable[str] = ()) -> tuple[Spelling, list[str]]:
    """Return the lines of the body of a function, and the `Spelling` that has chosen its identifiers.

    ``reserved`` are names that the function must not use.
    """
    spelling = Spelling(DIALECT, reserved, lowered.body)
    return spelling, [line for s in lowered.body for line in _statement(s, spelling, "    ")]


def _statement(s: ir.Statement, spelling: Spelling, indent: str) -> Iterator[str]:
    match s:
        case ir.Declare(in_place=True):
            spelling.substitute(s)
        case ir.Declare(_, items):
            yield from (f"{indent}{spelling.name(name)} = {spelling(value)}" for name, value in items)
        case ir.Unpack(names, value):
            yield f"{indent}{', '.join(names)} = {spelling(value)}"
        case ir.Assign(target, value, adds):
            yield f"{indent}{spelling(target)} {'+=' if adds else '='} {spelling(value)}"
        case ir.Append(series, value):
            yield f"{indent}{spelling(series)}.append({spelling(value)})"
        case ir.Call(name, arguments, instance):
            yield f"{indent}{spelling(ir.Called(name, arguments, instance))}"
        case ir.Within(context, body) | ir.If(context, body):
            keyword = "with" if isinstance(s, ir.Within) else "if"
            yield f"{indent}{keyword} {spelling(context)}:"
            yield from (line for inner in body for line in _statement(inner, spelling, f"{indent}    "))
        case ir.Return(value) if value:
            yield f"{indent}return {spelling(value)}"
        case _:
            raise TypeError(s)
