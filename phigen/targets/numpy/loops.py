"""Functions of the loop IR in NumPy, on whole arrays."""

from __future__ import annotations

from collections.abc import Iterator

from phigen.ir import nodes as ir
from phigen.scheme.kernel import Role
from phigen.targets.numpy.language import LANGUAGE
from phigen.targets.spelling import Dialect, Spelling

#: Identifiers that lowered functions of each role use, which names of users make way for.
_ALWAYS = {"coef", "x", "sites", "parameters", "h", "kick", "np", *LANGUAGE.functions.values()}
_BONDS = {"here", "there", "bond", "gathered"}
_TRANSPOSED = {"start", "bar", "own", "coef_bar", *_BONDS}
_RESERVED = {
    Role.GATHER: {"v", "sums", *_BONDS},
    Role.TRANSPOSED_SWEEP: {"change_bar", "colour", "window", *_TRANSPOSED},
    Role.TRANSPOSED_GATHER: {"gathered_bar", "sums_bar", *_TRANSPOSED},
}


def _reserved(role: Role) -> set[str]:
    if role.is_sweep:
        return {"v", "moved", "gathered", "colour", "window"}
    if role.is_stage:
        return {"start", "gathered", "v"}
    if role.is_observable:
        return {"out", "gathered"}
    return {"start_bar", *_TRANSPOSED} if role.is_transposed_stage else _RESERVED[role]


DIALECT = Dialect(LANGUAGE, operators={"not": "not "}, select="np.where({0}, {1}, {2})")


def function(lowered: ir.Function) -> str:
    """Return the text of a function on whole arrays."""
    spelling = Spelling(DIALECT, _ALWAYS | _reserved(lowered.role) | {*lowered.parameters}, lowered.body)
    lines = [line for s in lowered.body for line in _statement(s, spelling, "    ")]
    return "\n".join([f"def _{lowered.name}({', '.join(lowered.parameters)}):", *lines, ""])


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
