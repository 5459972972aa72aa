"""Kernels as C functions."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from phigen.scheme.kernel import Kernel
from phigen.scheme.program import Program
from phigen.symbolic import functions as elementary
from phigen.symbolic.symbols import WORK, Symbol, kind_of
from phigen.targets.code import Code, lower, parts
from phigen.targets.header import plain
from phigen.targets.names import Scope, identifiers
from phigen.targets.printer import Printer
from phigen.targets.reserved import C_RESERVED

FUNCTIONS = elementary.written_in("c")
# Digits, since -std=c99 hides M_PI.
CONSTANTS = {"pi": "3.141592653589793", "E": "2.718281828459045"}

#: Most assignments in one function; longer ones take quadratic time to compile.
LONGEST_FUNCTION = 200

#: Points at which a kernel for lanes is evaluated at once: what one vector of AVX-512 holds.
LANES = 8

#: Functions with a version of their own for the loops over lanes, and those that are formulas of these.
LANE_FUNCTIONS = tuple(f.name for f in elementary.FUNCTIONS.values() if f.lanes == f.name)
LANE_FORMULAS = {f.name: f.lanes for f in elementary.FUNCTIONS.values() if f.lanes not in ("", f.name)}


def function(
    program: Program,
    kernel: Kernel,
    *,
    lanes: bool = False,
    single: bool = False,
    sparse: bool = False,
    shared: Sequence[str] = (),
    functions: Mapping[str, str] | None = None,
) -> str:
    """The C source of a kernel: one function, or a chain of static ones that share a workspace.

    With ``lanes`` the kernel is evaluated at `LANES` points: each value becomes an array over them, but for the inputs
    that are ``shared``. A ``single`` one is evaluated at one of these points, the argument ``lane``, and its outputs
    are numbers. What is always zero is not stored if ``sparse``. ``functions`` are the names of those that it calls.
    """
    pieces = parts(lower(kernel), LONGEST_FUNCTION)
    workspace = 1 + max((k for p in pieces for k in p.kept), default=0)
    if functions is None:
        functions = lane_calls(program) if lanes else FUNCTIONS
    name = f"{program.name}_{kernel.name}{'_lane' if single else '_lanes' if lanes else ''}"
    plain_arrays = {*shared, "work", *(o.name for o in kernel.outputs)} if single else {*shared}
    form = Form(name, lanes, functions, frozenset(plain_arrays), single=single, sparse=sparse)
    if len(pieces) == 1:
        return _definition(program, kernel, form, pieces[0])
    texts = []
    for k, piece in enumerate(pieces, 1):
        part = replace(form, name=f"{form.name}_part{k}", workspace=workspace, part=(k, len(pieces)))
        texts.append(_definition(program, kernel, part, piece))
    arguments = ", ".join([*kernel.inputs, *(["lane"] if single else []), *(o.name for o in kernel.outputs), "work"])
    lines = [_purpose(program, kernel, form), *_signature(program, kernel, form), "{"]
    lines.append(f"    {form.number(program, 'work')} work[{workspace}];")
    lines += [f"    {form.name}_part{k}({arguments});" for k in range(1, len(pieces) + 1)]
    return "\n\n".join([*texts, "\n".join([*lines, "}"])])


def lane_calls(program: Program) -> Mapping[str, str]:
    """The functions that the loops over lanes call: their own versions where there are such."""
    own = {f: f"{program.name}_{f}_lane" for f in LANE_FUNCTIONS}
    return {**FUNCTIONS, **own, **{f: text.format_map(own) for f, text in LANE_FORMULAS.items()}}


@dataclass(frozen=True)
class Form:
    """How a kernel is printed: name; at one point or in lanes; what it calls; which arrays all lanes share;
    whole, or a ``part``; at a ``single`` lane; without zeros if ``sparse``."""

    name: str
    lanes: bool = False
    functions: Mapping[str, str] = field(default_factory=lambda: FUNCTIONS)
    shared: frozenset[str] = frozenset()
    workspace: int = 0
    part: tuple[int, int] = (1, 1)
    single: bool = False
    sparse: bool = False

    def number(self, program: Program, array: str) -> str:
        """The type of an entry of an array."""
        return f"{program.name}_lanes" if self.lanes and array not in self.shared else "double"

    def lane(self, array: str) -> str:
        """The inner index of an array."""
        return "[lane]" if self.lanes and array not in self.shared else ""


def _purpose(program: Program, kernel: Kernel, form: Form) -> str:
    if form.single:
        return _comment(f"{kernel.purpose}; in one lane")
    if form.lanes:
        return f"/* {program.name}_{kernel.name} in all lanes. */"
    return _comment(kernel.purpose)


def _definition(program: Program, kernel: Kernel, form: Form, code: Code) -> str:
    part = f"(part {form.part[0]} of {form.part[1]})"
    head = _purpose(program, kernel, form)
    if form.part[1] > 1:
        head = f"/* {form.name} {part} */" if form.lanes else _comment(f"{kernel.purpose} {part}")
    body = _body(program, kernel, form, code)
    if form.lanes and not form.single:
        loop = [f"{each_lane(program)}", f"for (int lane = 0; lane < {program.name}_LANES; ++lane) {{"]
        body = [line for line in body if "(void)" in line] + [
            *(f"    {line}" for line in loop),
            *(f"    {line}" for line in body if "(void)" not in line),
            "    }",
        ]
    return "\n".join([head, *_signature(program, kernel, form), "{", *body, "}"])


def _signature(program: Program, kernel: Kernel, form: Form) -> list[str]:
    # C99 has no conversion from double (*)[8] to const double (*)[8]: the inputs of lanes are not const.
    number = f"{program.name}_lanes" if form.lanes else "double"
    given, alone = (number, "restrict ") if form.lanes else ("const double", "")
    kinds = {i: ("const double", "") if i in form.shared else (given, alone) for i in kernel.inputs}
    arguments = [
        f"const {program.name}_params *params"
        if i == "params"
        else "double h"
        if i == "h"
        else f"{kinds[i][0]} {i}[{kinds[i][1]}{max(1, len(symbols))}]"
        for i, symbols in kernel.inputs.items()
    ]
    # restrict: the outputs never overlap the inputs. All kernels are static; callers of the API get no such duty.
    arguments += ["int lane"] if form.single else []
    arguments += [f"{form.number(program, o.name)} {o.name}[restrict {max(1, len(o.values))}]" for o in kernel.outputs]
    if form.workspace:
        arguments.append(f"{form.number(program, 'work')} work[restrict {form.workspace}]")
    kind = f"{apart(program)} static void " if form.workspace else "static void "
    return wrapped_arguments(f"{kind}{form.name}(", arguments)


def wrapped_arguments(head: str, arguments: Sequence[str]) -> list[str]:
    """``head(arguments)`` over as many lines as a width of 110 takes, continuation lines aligned."""
    lines = [head]
    for k, argument in enumerate(arguments):
        piece = argument + ("," if k + 1 < len(arguments) else ")")
        if len(lines[-1]) + len(piece) > 110 and lines[-1].strip():
            lines.append(" " * len(head))
        lines[-1] += piece if lines[-1].endswith("(") or not lines[-1].strip() else " " + piece
    return lines


def _body(program: Program, kernel: Kernel, form: Form, code: Code) -> list[str]:
    arrays = [*kernel.inputs, *(o.name for o in kernel.outputs), "work", "lane"]
    calls = {f: f"{program.name}_{f}" for f in elementary.FUNCTIONS} | dict(form.functions)
    called = re.findall(r"[A-Za-z_]\w*", " ".join(calls.values()))
    scope = Scope(C_RESERVED | {*arrays, *called})
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
            elif isinstance(s, Symbol):
                scope.bind(s, f"{array}[{i}]{form.lane(array)}")
            else:
                lines.append(f"    const double {scope[s]} = {array}[{i}]{form.lane(array)};")
    for k in range(form.workspace):
        scope.bind(Symbol(WORK, k), f"work[{k}]{form.lane('work')}")
    show = printer(scope, calls)
    for a in code.assignments:
        declare = "" if kind_of(a.target) == WORK else "const double "
        lines.append(f"    {declare}{scope[a.target]} = {show(a.value)};")
    stores = [s for s in code.stores if not (form.sparse and s.value.is_zero)]
    filled = {s.array for s in stores}
    lines += [f"    {s.array}[{s.index}]{form.lane(s.array)} = {show(s.value)};" for s in stores]
    unused = [i for i in kernel.inputs if i not in touched]
    unused += [o.name for o in kernel.outputs if o.name not in filled]
    if form.workspace and not any("work[" in line for line in lines):
        unused.append("work")
    return [*(f"    (void){u};" for u in unused), *lines]


def apart(program: Program) -> str:
    """The macro that keeps the parts of a long function from being inlined into one again."""
    return f"{program.name}_APART"


def printer(scope: Scope, functions: Mapping[str, str] = FUNCTIONS) -> Printer:
    """Prints lowered trees in C, with the names of a scope."""
    return Printer(lambda n: scope[n], functions, CONSTANTS, "pow")


def each_lane(program: Program) -> str:
    """The macro before a loop over lanes, which tells compilers that they are independent."""
    return f"{program.name}_EACH_LANE"


def members(program: Program) -> dict[str, str]:
    """The members of the parameter struct, by the names of the parameters."""
    return identifiers((p.name for p in program.parameters), C_RESERVED)


def _comment(text: str) -> str:
    return "\n".join(textwrap.wrap(f"/* {plain(text)} */", 110, subsequent_indent="   "))
