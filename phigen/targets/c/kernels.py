"""Kernels as C functions."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence

from phigen.scheme.program import Kernel, Program
from phigen.symbolic.entire import ENTIRE
from phigen.symbolic.special import SPECIAL
from phigen.targets.code import Code, lower, parts
from phigen.targets.header import plain
from phigen.targets.names import C_RESERVED, Scope
from phigen.targets.printer import Printer

_SAME: tuple[str, ...] = ("exp", "expm1", "log", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh")
_SAME += ("tanh", "asinh", "acosh", "atanh", "sqrt", "cbrt")
FUNCTIONS = {name: name for name in _SAME} | {
    "abs": "fabs",
    "power": "pow",
    "sign": "(double)(({0} > 0.0) - ({0} < 0.0))",
    "versin": "(2.0 * sin(0.5 * ({0})) * sin(0.5 * ({0})))",
}
# Digits, since -std=c99 hides M_PI.
CONSTANTS = {"pi": "3.141592653589793", "E": "2.718281828459045"}

#: Most assignments in one function; longer ones take quadratic time to compile.
LONGEST_FUNCTION = 200


def function(
    program: Program, kernel: Kernel, *, exported: bool = False, functions: Mapping[str, str] = FUNCTIONS
) -> str:
    """The C source of a kernel: one function, or a chain of static ones that share a workspace.

    ``functions`` are the names of those that it calls.
    """
    pieces = parts(lower(kernel), LONGEST_FUNCTION)
    workspace = 1 + max((int(a.target[2:]) for p in pieces for a in p.assignments if a.target[:2] == "w:"), default=0)
    name = f"{program.name}_{kernel.name}"
    if len(pieces) == 1:
        return _definition(program, kernel, name, pieces[0], functions, exported=exported)
    texts = [
        _definition(program, kernel, f"{name}_part{k}", piece, functions, workspace=workspace, part=(k, len(pieces)))
        for k, piece in enumerate(pieces, 1)
    ]
    arguments = ", ".join([*kernel.inputs, *(o.name for o in kernel.outputs), "work"])
    lines = [_comment(kernel.purpose), *_signature(program, kernel, name, exported=exported), "{"]
    lines.append(f"    double work[{workspace}];")
    if exported and "params" in kernel.inputs:
        lines.append(f"    if (params == NULL) params = &{program.name}_default_params;")
    lines += [f"    {name}_part{k}({arguments});" for k in range(1, len(pieces) + 1)]
    return "\n\n".join([*texts, "\n".join([*lines, "}"])])


def _definition(
    program: Program,
    kernel: Kernel,
    name: str,
    code: Code,
    functions: Mapping[str, str],
    *,
    exported: bool = False,
    workspace: int = 0,
    part: tuple[int, int] = (1, 1),
) -> str:
    head = kernel.purpose if part[1] == 1 else f"{kernel.purpose} (part {part[0]} of {part[1]})"
    lines = [_comment(head), *_signature(program, kernel, name, exported=exported, workspace=workspace), "{"]
    return "\n".join([*lines, *_body(program, kernel, code, functions, workspace, exported=exported), "}"])


def _signature(program: Program, kernel: Kernel, name: str, *, exported: bool = False, workspace: int = 0) -> list[str]:
    arguments = [
        f"const {program.name}_params *params"
        if i == "params"
        else "double h"
        if i == "h"
        else f"const double {i}[{max(1, len(symbols))}]"
        for i, symbols in kernel.inputs.items()
    ]
    # restrict: the outputs never overlap the inputs of our own calls; callers of the API get no such duty.
    qualifier = "" if exported else "restrict "
    for o in kernel.outputs:
        # The caller of NAME_casimirs sizes the array by NAME_CASIMIRS, which may be 0.
        size = "" if exported and kernel.name == "casimirs" else f"{qualifier}{max(1, len(o.values))}"
        arguments.append(f"double {o.name}[{size}]")
    if workspace:
        arguments.append(f"double work[restrict {workspace}]")
    text = ("void " if exported else f"{apart(program)} static void " if workspace else "static void ") + name + "("
    return wrapped_arguments(text, arguments)


def wrapped_arguments(head: str, arguments: Sequence[str]) -> list[str]:
    """``head(arguments)`` over as many lines as a width of 110 takes, continuation lines aligned."""
    lines = [head]
    for k, argument in enumerate(arguments):
        piece = argument + ("," if k + 1 < len(arguments) else ")")
        if len(lines[-1]) + len(piece) > 110 and lines[-1].strip():
            lines.append(" " * len(head))
        lines[-1] += piece if lines[-1].endswith("(") or not lines[-1].strip() else " " + piece
    return lines


def _body(
    program: Program, kernel: Kernel, code: Code, functions: Mapping[str, str], workspace: int, *, exported: bool
) -> list[str]:
    arrays = [*kernel.inputs, *(o.name for o in kernel.outputs), "work"]
    special = {f"function:{f}": f"{program.name}_{f}" for f in (*SPECIAL, *ENTIRE)}
    scope = Scope({*C_RESERVED, *arrays, *special.values(), *functions.values()})
    for f, name in special.items():
        scope.bind(f, name)
    member = members(program)
    lines: list[str] = []
    touched: set[str] = set()
    for array, symbols in kernel.inputs.items():
        for i, s in enumerate(symbols):
            if s not in code.used:
                continue
            touched.add(array)
            if array == "h":
                scope.bind(s, "h")
            elif array == "params":
                scope.bind(s, f"params->{member[s]}")
            elif ":" in s:
                scope.bind(s, f"{array}[{i}]")
            else:
                lines.append(f"    const double {scope[s]} = {array}[{i}];")
    for k in range(workspace):
        scope.bind(f"w:{k}", f"work[{k}]")
    show = printer(scope, functions)
    for a in code.assignments:
        declare = "" if a.target.startswith("w:") else "const double "
        lines.append(f"    {declare}{scope[a.target]} = {show(a.value)};")
    filled = {s.array for s in code.stores}
    lines += [f"    {s.array}[{s.index}] = {show(s.value)};" for s in code.stores]
    unused = [i for i in kernel.inputs if i not in touched]
    unused += [o.name for o in kernel.outputs if o.name not in filled]
    if workspace and not any("work[" in line for line in lines):
        unused.append("work")
    head = [f"    (void){u};" for u in unused]
    if exported and "params" in touched:
        head.append(f"    if (params == NULL) params = &{program.name}_default_params;")
    return [*head, *lines]


def apart(program: Program) -> str:
    """The macro that keeps the parts of a long function from being inlined into one again."""
    return f"{program.name}_APART"


def printer(scope: Scope, functions: Mapping[str, str] = FUNCTIONS) -> Printer:
    """Prints lowered trees in C, with the names of a scope."""
    return Printer(lambda n: scope[n], functions, CONSTANTS, "pow")


def members(program: Program) -> dict[str, str]:
    """The members of the parameter struct, by the names of the parameters."""
    scope = Scope(C_RESERVED)
    return {p.name: scope[p.name] for p in program.parameters}


def _comment(text: str) -> str:
    return "\n".join(textwrap.wrap(f"/* {plain(text)} */", 110, subsequent_indent="   "))
