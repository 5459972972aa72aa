"""Functions of the loop IR, the intermediate representation of generated code, as text: tests compare a function before
and after a pass.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from phigen.ir import nodes as ir
from phigen.symbolic.expression import Expression
from phigen.symbolic.symbols import Symbol


def text(function: ir.Function) -> str:
    """Return a function of the loop IR as text, one statement on each line."""
    head = f"{function.name}({', '.join(function.parameters)})"
    return "\n".join([head, *_lines(function.body, "  ")])


def _lines(body: ir.Block, indent: str) -> Iterator[str]:
    for s in body:
        match s:
            case ir.Declare(items=items):
                listed = ", ".join(f"{_symbol(name)} {':=' if s.in_place else '='} {_value(v)}" for name, v in items)
                yield f"{indent}{_kind(s.type)} {listed}"
            case ir.Store(array, value, adds):
                yield f"{indent}{_array(array)} {'+=' if adds else '<-'} {_value(value)}"
            case ir.Assign(target, value, adds):
                yield f"{indent}{_value(target)} {'+=' if adds else '<-'} {_value(value)}"
            case ir.Reduce(source, number, _, value):
                yield f"{indent}sum of {source}[{number}] += {_value(value)}"
            case ir.Clear(array, first, count):
                yield f"{indent}clear {_value(count)} of {_value(array)}{f' from {_value(first)}' if first else ''}"
            case ir.Copy(target, source, count):
                yield f"{indent}copy {f'{_value(count)} of ' if count else ''}{_value(source)} to {_value(target)}"
            case ir.Append(tape, vector):
                yield f"{indent}append {_value(vector)} to {_value(tape)}"
            case ir.Loop():
                bounds = f" {s.variable} in {_value(s.low)}..{_value(s.high)}" if s.low else ""
                bounds += f" by {_value(s.step)}" if s.step else ""
                chosen = "" if s.selection == ir.ALL_SITES else f" of colour {s.selection.colour}"
                threads = f" by threads above {s.threads} sites" if s.threads else ""
                yield f"{indent}{s.kind}{bounds}{chosen}{threads}:"
                yield from _lines(s.body, f"{indent}  ")
            case ir.If(condition, then, otherwise):
                yield f"{indent}if {_value(condition)}:"
                yield from _lines(then, f"{indent}  ")
                if otherwise:
                    yield f"{indent}else:"
                    yield from _lines(otherwise, f"{indent}  ")
            case ir.Switch(value, labels, cases):
                yield f"{indent}switch {_value(value)}:"
                for number, case in zip(labels, cases, strict=True):
                    yield f"{indent}  case {number}:"
                    yield from _lines(case, f"{indent}    ")
            case ir.Together(assignments):
                yield indent + ", ".join(line.strip() for line in _lines(assignments, ""))
            case ir.Discard(name):
                yield f"{indent}discard {name}"
            case ir.Comment(said):
                yield f"{indent}-- {said}"
            case ir.Within(context, inner):
                yield f"{indent}with {_value(context)}:"
                yield from _lines(inner, f"{indent}  ")
            case ir.Call(name, arguments, instance):
                yield f"{indent}{_value(ir.Called(name, arguments, instance))}"
            case ir.Unpack(names, value):
                yield f"{indent}{', '.join(names)} of {_value(value)}"
            case ir.Return(value):
                yield f"{indent}return {_value(value) if value else ''}".rstrip()
            case _:
                yield f"{indent}{type(s).__name__}"


def _kind(kind: Any) -> str:
    return kind.name.lower() if isinstance(kind, ir.Type) else type(kind).__name__.lower()


def _symbol(name: str) -> str:
    return str(name.key[0]) if isinstance(name, Symbol) and name.kind in (ir.FIXED, ir.LABEL) else str(name)


def _array(array: ir.Array) -> str:
    if array.storage is ir.Storage.SEED:
        return f"{array.name}[{array.number}]"
    return f"{array.storage.value}[{array.name or array.number}]"


def _value(value: Any) -> str:
    match value:
        case Expression():
            return str(value)
        case ir.Name(symbol):
            return _symbol(symbol)
        case ir.Constant(constant):
            return repr(constant)
        case ir.Load(array, offset, end):
            return f"{_array(array)}{[*offset] if any(offset) else ''}{end}"
        case ir.BondParameter(_, name, oriented):
            return f"{'side * ' * oriented}bond {name}"
        case ir.Member(record, name):
            return f"{_value(record)}.{name}"
        case ir.Entry(array, index):
            return f"{_value(array)}[{_value(index)}]"
        case ir.Binary(operator, left, right):
            return f"({_value(left)} {operator} {_value(right)})"
        case ir.Select(condition, then, otherwise):
            return f"({_value(then)} if {_value(condition)} else {_value(otherwise)})"
        case ir.Accumulated(start, terms):
            return f"({_value(start)} + ... {_value(terms)})"
        case ir.Cast(inner):
            return _value(inner)
        case ir.Prefix(operator, inner):
            return f"{operator}{_value(inner)}"
        case ir.Grouped(inner):
            return f"({_value(inner)})"
        case ir.Listed(values):
            return f"[{', '.join(map(_value, values))}]"
        case ir.Called(name, arguments, instance):
            owner = f"{_value(instance)}." if instance else ""
            return f"{owner}{name}({', '.join(map(_value, arguments))})"
    return repr(value)
