"""Kernels as Python functions that use NumPy."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import replace

from phigen.ir import nodes as ir
from phigen.ir.kernel_functions import kernel_function
from phigen.ir.passes.zeros import stored_array
from phigen.scheme.kernel import EXPONENTS, SCALARS, Kernel
from phigen.scheme.program import Program
from phigen.scheme.staging import TABLE
from phigen.symbolic.symbols import Symbol
from phigen.targets.header import plain, sentence
from phigen.targets.numpy.loops import statements


def function(program: Program, kernel: Kernel) -> str:
    """Return a kernel as a function of arrays, which may have any number of axes before the axis of the coordinates."""
    if kernel.exponents:
        return _through_exponentials(program, kernel, kernel.exponents)
    arguments = ", ".join("parameters" if i == "params" else i for i in kernel.inputs)
    built = kernel_function(kernel, {p: p for p in kernel.inputs.get("params", ())}, named=True)
    spelling, lines = statements(over_states(built), {*built.parameters, "parameters"})
    values: dict[str, list[str]] = {o.name: [] for o in kernel.outputs}
    for s in built.body:
        if isinstance(s, ir.Assign):
            values[stored_array(s)].append(spelling(s.value))
    head = [f"def _{kernel.name}({arguments}):", *_docstring(kernel.purpose)]
    return "\n".join([*head, *lines, _result(program, kernel, values)]) + "\n"


def over_states(function: ir.Function) -> ir.Function:
    """Return the function of a kernel, rewritten for arrays of states whose last axis is that of the coordinates.

    Parameters are read from a dictionary. The function returns its outputs as lists.
    """

    def read(name: str, value: ir.Value) -> ir.Value:
        match value:
            case ir.Member(_, member):
                return ir.entry(ir.fixed("parameters"), member)
            case ir.Entry(array, index) if not isinstance(name, Symbol):
                return ir.Entry(array, ir.Several((ir.fixed("..."), index)))
        return value

    declarations = (s for s in function.body if isinstance(s, ir.Declare))
    return function.with_body(*(replace(s, items=tuple((n, read(n, v)) for n, v in s.items)) for s in declarations))


def _through_exponentials(program: Program, kernel: Kernel, inner: Kernel) -> str:
    """Return the transpose of a kernel that computes matrix exponentials, as the text of three functions.

    The first function computes the matrices, the second receives their cotangents, and the third calls the other two.
    """
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


def _result(program: Program, kernel: Kernel, values: Mapping[str, Sequence[str]]) -> str:
    state = _state(kernel)
    if not state:
        lists = [*map(_list, values.values())]
        if kernel.exponentials:
            lists[0] = f"_with_exponentials({lists[0]}, {kernel.exponentials!r})"
        return "    return " + ", ".join(lists)
    n = program.dimension
    arrays = []
    for name, entries in values.items():
        array = f"_filled({state}, {_list(entries)})"
        arrays.append(array + (f".reshape({state}.shape + ({n},))" if name.endswith("jacobian") else ""))
    if len(arrays) == 1:
        return f"    return {arrays[0]}"
    return "    return (\n" + "".join(f"        {a},\n" for a in arrays) + "    )"


def _state(kernel: Kernel) -> str:
    """Return the name of the argument that holds states, of the shape (..., DIM); "" if there is none. The states
    determine the shape of results.
    """
    others = [a for a in kernel.inputs if a not in (TABLE, "params", "gauge", *SCALARS)]
    return next((a for a in others if kernel.inputs[a] and not isinstance(kernel.inputs[a][0], Symbol)), "")


def _list(items: Sequence[str]) -> str:
    text = "[" + ", ".join(items) + "]"
    if len(text) < 90:
        return text
    return "[\n" + "".join(f"            {i},\n" for i in items) + "        ]"
