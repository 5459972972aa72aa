"""Kernels as functions of NumPy."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import replace

from phigen.scheme.kernel import EXPONENTS, SCALARS, Kernel
from phigen.scheme.program import Program
from phigen.scheme.staging import TABLE
from phigen.symbolic.expression import Expression
from phigen.symbolic.symbols import Symbol
from phigen.targets.code import Code, bound, lower
from phigen.targets.header import plain, sentence
from phigen.targets.names import Scope
from phigen.targets.numpy.language import LANGUAGE
from phigen.targets.printer import Printer
from phigen.targets.reserved import PYTHON_RESERVED


def function(program: Program, kernel: Kernel) -> str:
    """Return a kernel as a function of arrays with any number of axes before that of the coordinates."""
    if kernel.exponents:
        return _through_exponentials(program, kernel, kernel.exponents)
    code = lower(kernel)
    arguments = ", ".join("parameters" if i == "params" else i for i in kernel.inputs)
    lines = [f"def _{kernel.name}({arguments}):", *_docstring(kernel.purpose)]
    reserved = PYTHON_RESERVED | {*kernel.inputs, *(o.name for o in kernel.outputs), *LANGUAGE.functions.values()}
    scope = Scope(reserved)
    lines += _bindings(kernel, code, scope)
    printer = LANGUAGE.printer(scope)
    lines += [f"    {scope[a.target]} = {printer(a.value)}" for a in code.assignments]
    lines.append(_result(program, kernel, code, printer))
    return "\n".join(lines) + "\n"


def _through_exponentials(program: Program, kernel: Kernel, inner: Kernel) -> str:
    """Return the transpose of a kernel with matrix exponentials: functions of the matrices and of their cotangents."""
    outer = replace(kernel, name=f"{kernel.name}_of_exponents", exponentials=(), exponents=None)
    names = {i: "parameters" if i == "params" else i for i in kernel.inputs}
    matrices = f"_{inner.name}({', '.join(names[i] for i in inner.inputs)})"
    lines = [
        f"def _{kernel.name}({', '.join(name for i, name in names.items() if i != EXPONENTS)}):",
        *_docstring(kernel.purpose),
        f"    {EXPONENTS} = _exponents_bar({matrices}, coef_bar, {kernel.exponentials!r})",
        f"    return _{outer.name}({', '.join(names.values())})",
    ]
    return "\n\n".join([function(program, inner), function(program, outer), "\n".join(lines) + "\n"])


def _docstring(text: str) -> list[str]:
    said = plain(sentence(text)).replace(chr(34), chr(39))
    return textwrap.wrap(f'"""{said}"""', 104, initial_indent="    ", subsequent_indent="    ")


def _bindings(kernel: Kernel, code: Code, scope: Scope) -> list[str]:
    def entry(array: str, i: int, s: str) -> str:
        return array if array in SCALARS else f"{array}[{i}]" if isinstance(s, Symbol) else f"{array}[..., {i}]"

    named = bound(kernel, code, scope, lambda s: f'parameters["{s}"]', entry, named=True)
    return [f"    {name} = {place}" for name, place in named]


def _result(program: Program, kernel: Kernel, code: Code, printer: Printer) -> str:
    values: dict[str, list[Expression]] = {o.name: [] for o in kernel.outputs}
    for s in code.stores:
        values[s.array].append(s.value)
    state = _state(kernel)
    if not state:
        lists = [_list([printer(v) for v in entries]) for entries in values.values()]
        if kernel.exponentials:
            lists[0] = f"_with_exponentials({lists[0]}, {kernel.exponentials!r})"
        return "    return " + ", ".join(lists)
    n = program.dimension
    arrays = []
    for name, entries in values.items():
        array = f"_filled({state}, {_list([printer(e) for e in entries])})"
        arrays.append(array + (f".reshape({state}.shape + ({n},))" if name.endswith("jacobian") else ""))
    if len(arrays) == 1:
        return f"    return {arrays[0]}"
    return "    return (\n" + "".join(f"        {a},\n" for a in arrays) + "    )"


def _state(kernel: Kernel) -> str:
    """Return the argument that holds states (..., DIM), whose shape results have; "" if there is none."""
    others = [a for a in kernel.inputs if a not in (TABLE, "params", "gauge", *SCALARS)]
    return next((a for a in others if kernel.inputs[a] and not isinstance(kernel.inputs[a][0], Symbol)), "")


def _list(items: Sequence[str]) -> str:
    text = "[" + ", ".join(items) + "]"
    if len(text) < 90:
        return text
    return "[\n" + "".join(f"            {i},\n" for i in items) + "        ]"
