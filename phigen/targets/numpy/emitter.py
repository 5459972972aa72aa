"""A program as a Python module: `NAME.py`."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import replace

from phigen.scheme.alternation import Schedule
from phigen.scheme.program import PLAUSIBLE, Kernel, Program
from phigen.symbolic.entire import ENTIRE
from phigen.symbolic.expression import Expression
from phigen.symbolic.special import SPECIAL
from phigen.targets import special
from phigen.targets.code import Code, lower
from phigen.targets.header import CHECKSUM, checksum, header_lines, plain
from phigen.targets.names import PYTHON_RESERVED, Scope
from phigen.targets.path import Syntax, statements, tangent_program
from phigen.targets.printer import Printer
from phigen.targets.rendering import render

#: Most terms of the expansion of a path, as in the C target.
TERMS = 30

FUNCTIONS = {
    "asin": "np.arcsin",
    "acos": "np.arccos",
    "atan": "np.arctan",
    "atan2": "np.arctan2",
    "asinh": "np.arcsinh",
    "acosh": "np.arccosh",
    "atanh": "np.arctanh",
    "abs": "np.abs",
    "power": "np.power",
    "sign": "np.sign({0})",
    "inv": "np.where({0} > 0.0, 1.0 / ({0}), np.nan)",
    "versin": "(2.0 * np.sin(0.5 * ({0})) ** 2)",
} | {
    name: f"np.{name}"
    for name in ["exp", "expm1", "log1p", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh", "sqrt", "cbrt"]
}
CONSTANTS = {"pi": "np.pi", "E": "np.e"}


def _printer(scope: Scope) -> Printer:
    return Printer(lambda n: scope[n], FUNCTIONS, CONSTANTS, "np.power")


PATH_SYNTAX = Syntax(
    printer=_printer,
    covector="p[:, {i}]",
    fixed="f{i} = {value}",
    first="s[{i}].append({value} + 0.0)",
    following="s[{i}].append({value})",
    slope="s[{i}].append(s[{slope}][k] / (k + 1))",
    sums="",
)


def emit(program: Program, command: str) -> dict[str, str]:
    """The file name and its contents."""
    kernels = program.kernels
    pieces = [render("numpy", "preamble.py", _values(program))]
    pieces += [render("numpy", "phi.py", special.values(f, f"_{f}")) for f in special.used(program)]
    pieces += [render("numpy", "entire.py", special.entire_values(f)) for f in special.entire_used(program)]
    pieces += _driver(program)
    gauge = ("gauge_line.py", "gauge.py") if program.gauge else ("no_gauge.py",)
    pieces += [render("numpy", template, _values(program)) for template in gauge]
    pieces += [_function(program, kernels[k]) for k in ("guide", "products") if k in kernels]
    pieces += [render("numpy", part, _values(program)) for part in ("coefficients.py", "api.py")]
    pieces += [_function(program, kernels[k]) for k in ("energy", "casimirs", "vector_field")]
    pieces += [render("numpy", "observables.py", _values(program))]
    if program.extras.tangent:
        pieces += _tangent(program)
    if "modified" in kernels:
        order = program.order + (2 if program.symmetric else 1) * program.extras.modified_hamiltonian
        pieces += [_function(program, kernels["modified"]), render("numpy", "modified.py", {"modified_power": order})]
    body = "\n\n".join(p.strip("\n") + "\n" for p in pieces)
    comment = "\n".join(f"# {line}".rstrip() for line in header_lines(program, command))
    return {f"{program.name}.py": f"{comment}\n# {CHECKSUM} {checksum(body)}\n{body}"}


def _driver(program: Program) -> list[str]:
    """The functions that make a stage."""
    kernels, values = program.kernels, _values(program)
    if program.schedule:
        row = _function(program, replace(kernels["prepare"], name="prepare_row"))
        flows = [_function(program, kernel) for name, kernel in kernels.items() if name.startswith("flow")]
        own = values | _splitting_values(program, program.schedule)
        rows = "rows_kicks.py" if program.schedule.multiples else "rows.py"
        return [row, *flows, render("numpy", "splitting.py", own), render("numpy", rows, own)]
    prepare = _function(program, kernels["prepare"])
    if program.driver == "explicit":
        return [prepare, _function(program, kernels["explicit"]), render("numpy", "explicit.py", values)]
    if program.path:
        path = values | statements(program, program.path, PATH_SYNTAX)
        parts = ("holds", "piece", "path", "residual", "solve", "plausible", "path_step")
        generate = _function(program, kernels["generate"])
        return [prepare, generate, *(render("numpy", f"{part}.py", path) for part in parts)]
    linearise = _function(program, kernels["linearise"])
    return [prepare, linearise, *(render("numpy", f"{part}.py", values) for part in ("solve", "plausible", "newton"))]


def _splitting_values(program: Program, schedule: Schedule) -> dict[str, object]:
    count = sum(name.startswith("flow") for name in program.kernels)
    return {
        "times": "(" + "".join(f"{t!r}, " for t in schedule.times).rstrip() + ")",
        "multiples": "(" + "".join(f"{m!r}, " for m in schedule.multiples).rstrip() + ")",
        "row": program.coefficients // len(schedule.times),
        "schedule": repr(tuple(schedule.flows)),
        "flows": ", ".join(f"_flow{k}" for k in range(1, count + 1)),
        "tangents": ", ".join(f"_tangent{k}" for k in range(1, count + 1)),
    }


def _tangent(program: Program) -> list[str]:
    """The tangent map of a step, with what it needs."""
    values, pieces = _values(program), []
    if program.schedule:
        values |= _splitting_values(program, program.schedule)
        pieces += [_function(program, k) for name, k in program.kernels.items() if name.startswith("tangent")]
    elif program.driver == "explicit":
        pieces += [_function(program, program.kernels["explicit_tangent"])]
    elif program.tangent_path:
        extended = tangent_program(program)
        path = program.tangent_path
        values |= statements(extended, path, PATH_SYNTAX)
        values |= {"series": len(path.series), "n_twice": extended.dimension}
        pieces += [_function(program, program.kernels["curvature"])]
        pieces += [render("numpy", f"tangent_{part}.py", values) for part in ("holds", "piece", "seeds")]
    pieces.append(render("numpy", f"tangent_{program.driver}.py", values))
    return [*pieces, render("numpy", "tangent.py", values)]


def _values(program: Program) -> dict[str, object]:
    return {
        "title": plain(program.title) or program.name,
        "n": program.dimension,
        "order": program.order,
        "version": program.version,
        "sha256": program.spec_sha256,
        "coordinates": _strings(program.coordinates),
        "casimirs": _strings(program.casimirs),
        "defaults": [f'"{p.name}": {float(p.value)!r}' for p in program.parameters],
        "gauge": _strings(program.gauge),
        "plausible": repr(PLAUSIBLE),
        "fractions": "(" + "".join(f"{f!r}, " for f in program.fractions).rstrip() + ")",
        "terms": TERMS,
        "series": len(program.path.series) if program.path else 0,
        "max_iterations": program.max_iterations,
        "tolerance": repr(program.tolerance),
        # The floor of the scale of a component: see _size.
        "floor": "0.0" if program.relative else "1e-6",
    }


def _strings(names: Sequence[str]) -> str:
    return "(" + "".join(f'"{n}", ' for n in names).rstrip() + ")"


def _function(program: Program, kernel: Kernel) -> str:
    code = lower(kernel)
    arguments = ", ".join("parameters" if i == "params" else i for i in kernel.inputs)
    lines = [f"def _{kernel.name}({arguments}):", *_docstring(kernel.purpose)]
    own = (*SPECIAL, *ENTIRE)
    scope = Scope({*PYTHON_RESERVED, *kernel.inputs, *(o.name for o in kernel.outputs), *(f"_{f}" for f in own)})
    for f in own:
        scope.bind(f"function:{f}", f"_{f}")
    lines += _bindings(kernel, code, scope)
    printer = _printer(scope)
    lines += [f"    {scope[a.target]} = {printer(a.value)}" for a in code.assignments]
    lines.append(_result(program, kernel, code, printer))
    return "\n".join(lines) + "\n"


def _docstring(text: str) -> list[str]:
    said = plain(text).replace(chr(34), chr(39))
    quoted = f'"""{said[:1].upper()}{said[1:]}."""'
    return textwrap.wrap(quoted, 104, initial_indent="    ", subsequent_indent="    ")


def _bindings(kernel: Kernel, code: Code, scope: Scope) -> list[str]:
    lines = []
    for array, symbols in kernel.inputs.items():
        for i, s in enumerate(symbols):
            if s not in code.used:
                continue
            if array == "h":
                scope.bind(s, "h")
            elif array == "params":
                lines.append(f'    {scope[s]} = parameters["{s}"]')
            elif ":" in s:
                scope.bind(s, f"{array}[{i}]")
            else:
                lines.append(f"    {scope[s]} = {array}[..., {i}]")
    return lines


def _result(program: Program, kernel: Kernel, code: Code, printer: Printer) -> str:
    values: dict[str, list[Expression]] = {o.name: [] for o in kernel.outputs}
    for s in code.stores:
        values[s.array].append(s.value)
    if kernel.outputs[0].name == "coef":
        return "    return " + _list([printer(v) for v in values["coef"]])
    state = next(a for a in kernel.inputs if a not in ("coef", "params", "gauge", "h"))
    n = program.dimension
    arrays = []
    for name, entries in values.items():
        array = f"_filled({state}, {_list([printer(e) for e in entries])})"
        arrays.append(array + (f".reshape({state}.shape + ({n},))" if name.endswith("jacobian") else ""))
    if len(arrays) == 1:
        return f"    return {arrays[0]}"
    return "    return (\n" + "".join(f"        {a},\n" for a in arrays) + "    )"


def _list(items: Sequence[str]) -> str:
    text = "[" + ", ".join(items) + "]"
    if len(text) < 90:
        return text
    return "[\n" + "".join(f"            {i},\n" for i in items) + "        ]"
