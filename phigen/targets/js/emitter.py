"""Emission of a program as an ES module, `NAME.mjs`."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping

from phigen.errors import Diagnostic, SpecError
from phigen.ir.kernel_functions import kernel_function
from phigen.ir.passes.zeros import zeros_first
from phigen.scheme.kernel import Kernel
from phigen.scheme.policies import POLICIES
from phigen.scheme.program import Attitude, Program
from phigen.scheme.steps import Sweeps
from phigen.targets import special
from phigen.targets.features import switches
from phigen.targets.header import facts, header_lines, sealed
from phigen.targets.js.files import LATTICE_MODULES, MODULES, chosen
from phigen.targets.js.functions import definitions, elliptic_definitions
from phigen.targets.js.loops import statements
from phigen.targets.js.printing import LANGUAGE, camel, comment, key, properties
from phigen.targets.js.runtime import assembled
from phigen.targets.js.step_modules import STEP_MODULES
from phigen.targets.policies import policies_of
from phigen.targets.rendering import render


def emit(program: Program, command: str) -> dict[str, str]:
    """Return a map from the name of the generated file to its text. Raises `SpecError` if the program needs something
    that the target lacks.
    """
    expect_offered(program)
    body = _lattice(program, program.step.swept) if program.step.swept else _system_of_coordinates(program)
    return {f"{program.name}.mjs": sealed(header_lines(program, command), body)}


def expect_offered(program: Program) -> None:
    """Raise `SpecError` if the program has the transpose of steps (``adjoint``), which the JavaScript target does not
    offer.
    """
    if program.step.adjoint:
        message = f"{program.name}: gradients (adjoint) are not offered in JavaScript"
        raise SpecError([Diagnostic(message, hint="the targets c and numpy offer gradients")])


def _lattice(program: Program, step: Sweeps) -> str:
    """Return the text of the module of a lattice, without its header."""
    from phigen.targets.js import lattice_tables

    features = lattice_tables.features(program, step)
    early = [_function(kernel) for kernel in (step.prepare, step.refresh) if kernel]
    pieces = [lattice_tables.tables(program, step), *early, *_functions(program)]
    model = "\n\n".join(piece.strip("\n") for piece in (*pieces, *lattice_tables.kernels(program, step)))
    return f"{model}\n\n{assembled(chosen(LATTICE_MODULES, features), features, POLICIES)}\n"


def _system_of_coordinates(program: Program) -> str:
    """Return the text of the module of a system that is no lattice, without its header."""
    choice = {"GAUGE_CHOSEN": bool(program.gauge), "GAUGE_SEARCHED": program.searches_gauge}
    features = switches(program) | choice
    modules = chosen(MODULES, features)
    return f"{_model(program)}\n\n{assembled(modules, features, policies_of(program))}\n"


def _functions(program: Program) -> list[str]:
    """Return the definitions of the elementary functions that kernels call and that JavaScript lacks."""
    anomaly = special.calls_anomaly(program)
    functions = definitions(special.used(program), special.entire_used(program), LANGUAGE.printer, anomaly=anomaly)
    functions += elliptic_definitions(special.elliptic_used(program))
    remainders = special.remainders_used(program)
    functions += (
        [render("js", "remainders.mjs", special.remainder_values(remainders)).strip("\n")] if remainders else []
    )
    if special.largest_exponential(program):
        functions.append(render("js", "matrix_exponential.mjs", special.exponential_constants()).strip("\n"))
    return functions


def _model(program: Program) -> str:
    """Return the text of the constants and kernels of a system that is no lattice."""
    step = program.step
    text = STEP_MODULES[step.kind.name]
    pieces = [render("js", "system.mjs", _system(program))]
    pieces += text.constants(program, step)
    pieces += _functions(program)
    pieces += [_function(kernel) for kernel in _kernels(program)]
    pieces += text.series(program, step)
    return "\n\n".join(piece.strip("\n") for piece in pieces)


def _system(program: Program) -> Mapping[str, object]:
    return {
        "contents": [f" * {part}".rstrip() for line in _contents(program) for part in textwrap.wrap(line, 100) or [""]],
        **facts(program, json.dumps, key, "null"),
        "properties": properties(program.parameters),
        "gauge": json.dumps(program.held) if program.held else "",
        "monitored": program.monitor is not None,
        "attitude": render("js", "attitude.mjs", _sizes(program.attitude)) if program.attitude else "",
        "fractions": json.dumps(program.fractions),
        "table": render("js", "table.mjs", _table(program)).strip("\n"),
    }


def _sizes(attitude: Attitude) -> Mapping[str, int]:
    """Return the sizes of arrays in the JavaScript for attitudes, as template values."""
    group, rate, rows = attitude.group, attitude.rate, attitude.group.rows
    covector = len(group.matrices) + 1 if attitude.exponential else 0
    return {
        "attitude": rows**2 or 4,
        "element": group.size,
        "position": group.size > (rows**2 or 4),
        "rows": rows,
        "covector": covector,
        "turning": len(rate.roots) if rate else 0,
    }


def _table(program: Program) -> Mapping[str, object]:
    """Return the sizes of the table of coefficients, as template values."""
    step, schedule = program.step, program.step.flow_schedule
    return {
        "middles": json.dumps(program.midpoints) if step.refresh else "",
        "prepared": step.prepared,
        "renewing": "time or noise" if program.noise else "the time",
        "coefficients": step.row,
        "moments": json.dumps(schedule.moments) if schedule and step.refresh else "",
        "times": schedule is not None,
    }


def _contents(program: Program) -> list[str]:
    """Return the lines for the header of a module: an example of its use, and its table of contents."""
    lines = [
        f"import {{ Solver, StepError }} from './{program.name}.mjs';",
        f"const solver = new Solver({{ x0: [...],{' t0,' * bool(program.time)} params: {{ ... }} }});",
        "solver.integrate(h, steps); then solver.x, .t, .hamiltonian(), .casimirs(), .vectorField()",
        "",
        "Contents: the system and its formulas; the class Solver; the step, by " + program.step.kind.title + ".",
    ]
    return lines


def _kernels(program: Program) -> list[Kernel]:
    """Return the kernels that the runtime calls."""
    step = program.step
    modified = [program.modified.kernel] if program.modified else []
    timed = [k for k in (program.monitor.elapsed, program.monitor.rate) if k] if program.monitor else []
    noisy = [program.noise.fields] if program.noise and program.noise.fields else []
    turned = program.attitude
    turning = [k for k in (turned.exponential, turned.turn, turned.rate) if k] if turned else []
    others = [*turning, *program.choice, *timed, *noisy, *modified, *program.observables.kernels]
    return [*filter(None, STEP_MODULES[step.kind.name].kernels(program, step)), *others]


def _function(kernel: Kernel) -> str:
    """Return a kernel as the text of a function that writes its outputs to arrays."""
    arrays = {argument: camel(argument) for argument in (*kernel.inputs, *(o.name for o in kernel.outputs))}
    head = f"function {camel(kernel.name)}({', '.join(arrays.values())}) {{"
    lines = statements(zeros_first(kernel_function(kernel, {p: p for p in kernel.inputs.get("params", ())}, arrays)))
    stored = camel(kernel.outputs[0].name)
    for start, n in kernel.exponentials:
        lines.append(f"  matrixExponential({n}, {stored}.subarray({start}, {start + n * n}));")
    return "\n".join([*comment(kernel.purpose), head, *lines, "}"])
