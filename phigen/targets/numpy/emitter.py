"""A program as a Python module: `NAME.py`."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import replace

from phigen.scheme.kernel import SCALARS, Kernel, Output
from phigen.scheme.path import Recurrences
from phigen.scheme.program import Attitude, Program
from phigen.scheme.staging import TABLE
from phigen.scheme.steps import (
    LONGEST_PATH,
    MOST_PIECES,
    PLAUSIBLE,
    Adjoint,
    Explicit,
    Implicit,
    InnerSolve,
    Newton,
    Path,
    PathAdjoint,
    Splitting,
    Step,
    Sweeps,
)
from phigen.symbolic.expression import Expression
from phigen.symbolic.symbols import Symbol
from phigen.targets.code import Code, bound, lower
from phigen.targets.header import facts, header_lines, plain, sealed, sentence
from phigen.targets.names import Scope
from phigen.targets.numpy import functions
from phigen.targets.numpy.language import LANGUAGE, listed, quoted
from phigen.targets.path import TERMS, Syntax, statements, tangent_program
from phigen.targets.printer import Printer
from phigen.targets.rendering import render
from phigen.targets.reserved import PYTHON_RESERVED

_NOISE_ARGUMENTS = """ The random
    numbers are a function of seed, member (that of the first, or one for each) and the number of the step, from step0
    on; increments (steps, increments) for all members, or (steps, members, increments), take their place."""

#: What is said of what a trajectory holds fixed, and of steps in tau.
_OF_GAUGE = """gauge (one value for each Casimir in GAUGE)
    overrides the choice of the solver: the step is an exact Poisson map for each fixed gauge."""
_OF_LEVEL = """gauge overrides e = -H(x0): the step
    is an exact Poisson map for each fixed e."""
_OF_TAU = """

    The steps are of size h in tau; with times the result is a pair of the states and their times t: (rows, ...)."""

PATH_SYNTAX = Syntax(
    LANGUAGE.printer,
    slope="s[{i}].append(s[{slope}][k] / (k + 1))",
    sums="_{kind}",
    covector="p[:, {i}]",
    fixed="f{i} = {value}",
    held="f{i}",
    first="s[{i}].append({value} + 0.0)",
    following="s[{i}].append({value})",
)


def emit(program: Program, command: str) -> dict[str, str]:
    """The file name and its contents."""
    body = _body(program)
    return {f"{program.name}.py": sealed(header_lines(program, command), body, "# ", "", "")}


def _body(program: Program) -> str:
    """The module without its header."""
    if isinstance(program.step, Sweeps):
        from phigen.targets.numpy import lattice

        early = [
            program.step.prepare,
            program.step.refresh,
            *([program.step.adjoint.prepare, program.step.adjoint.refresh] if program.step.adjoint else []),
        ]
        return lattice.body(
            program, program.step, "\n\n".join(_function(program, kernel) for kernel in early if kernel)
        )
    pieces = [render("numpy", part, _values(program)) for part in ("preamble.py", "arrays.py", "parameters.py")]
    pieces += functions.called(program)
    pieces += _step(program)
    search = ("gauge_line.py", "gauge.py") if program.searches_gauge else ("gauge_formula.py",)
    templates = search if program.gauge else ("level.py",) if program.monitor else ("no_gauge.py",)
    pieces += [render("numpy", template, _values(program)) for template in templates]
    pieces += [_function(program, kernel) for kernel in program.choice]
    pieces += _monitor(program)
    coefficients = ["coefficients_in_time.py" if program.time else "coefficients.py"]
    if program.noise:
        coefficients = ["noise.py", "philox.py", "normals.py", "drawing.py", "renewed.py"]
    parts = (*coefficients, "single.py", "checked.py", "integrate.py")
    pieces += [render("numpy", part, _values(program)) for part in parts]
    pieces += [_function(program, kernel) for kernel in program.observables.kernels]
    pieces += [_function(program, program.noise.fields)] if program.noise and program.noise.fields else []
    pieces += [render("numpy", "observables.py", _values(program))]
    if program.extras.tangent:
        pieces += _tangent(program)
    if program.step.adjoint:
        pieces += _adjoint(program, program.step.adjoint)
    if program.attitude:
        pieces += _attitude(program, program.attitude)
    if program.modified:
        values = {
            "modified_power": program.modified.power,
            "t_given": ", t" * bool(program.time),
            "said_at_t": " at the time t" * bool(program.time),
            "t_passed": ", np.asarray(t, dtype=float)" * bool(program.time),
        }
        pieces += [_function(program, program.modified.kernel), render("numpy", "modified.py", values)]
    return "\n\n".join(p.strip("\n") + "\n" for p in pieces)


def _step(program: Program) -> list[str]:
    """The functions that make a stage."""
    values = _values(program)

    def rendered(*parts: str) -> list[str]:
        return [render("numpy", f"{part}.py", values) for part in parts]

    refresh, prepare = program.step.refresh, program.step.prepare
    renewing = [_function(program, refresh)] if refresh else []
    early = [_function(program, prepare), *renewing]
    guess = "anew" if program.noise else "guess"
    match program.step:
        case Splitting(flows=flows, schedule=schedule) as step:
            values |= _splitting_values(step)
            row = _function(program, replace(prepare, name="prepare_row"))
            rows = "rows_kicks" if schedule.multiples else "rows"
            return [row, *renewing, *(_function(program, flow) for flow in flows), *rendered("splitting", rows)]
        case Explicit(increment=increment):
            return [*early, _function(program, increment), *rendered("explicit")]
        case Path(recurrences=path, generate=generate):
            values |= statements(program, path, PATH_SYNTAX)
            parts = rendered("holds", "piece", "path", "residual", "solve", "plausible", "path_step", f"path_{guess}")
            return [*early, _function(program, generate), *parts]
        case Newton(linearise=linearise):
            parts = rendered("solve", "plausible", "newton", f"newton_{guess}")
            return [*early, _function(program, linearise), *parts]
        case Sweeps():
            raise AssertionError("lattices have a module of their own")


def _monitor(program: Program) -> list[str]:
    """The time that steps take, of a monitored solver."""
    if not program.monitor:
        return []
    kernels = [k for k in (program.monitor.elapsed, program.monitor.rate) if k]
    return [*(_function(program, kernel) for kernel in kernels), render("numpy", "elapsed.py", _values(program))]


def _splitting_values(step: Splitting) -> dict[str, object]:
    schedule, numbers = step.schedule, range(1, len(step.flows) + 1)
    return {
        "times": listed(schedule.times),
        "multiples": listed(schedule.multiples),
        "row": step.row,
        "schedule": repr(tuple(schedule.flows)),
        "flows": ", ".join(f"_flow{k}" for k in numbers),
        "tangents": ", ".join(f"_tangent{k}" for k in numbers),
    }


def _tangent(program: Program) -> list[str]:
    """The tangent map of a step, with what it needs."""
    values, kernels, parts = _values(program), list[Kernel](), list[str]()
    match program.step:
        case Splitting(tangents=tangents) as step:
            values |= _splitting_values(step)
            kernels, parts = list(tangents), ["splitting"]
        case Explicit(tangent=tangent) if tangent:
            kernels, parts = [tangent], ["explicit"]
        case Path(tangent=varied) if varied:
            extended, path = tangent_program(program), varied.recurrences
            values |= statements(extended, path, PATH_SYNTAX)
            values |= {"series": len(path.series), "n_twice": extended.dimension}
            kernels, parts = [varied.curvature], ["holds", "piece", "seeds", "path"]
        case Newton():
            parts = ["newton"]
    pieces = [_function(program, kernel) for kernel in kernels]
    pieces += [render("numpy", f"tangent_{part}.py", values) for part in parts]
    return [*pieces, render("numpy", "tangent.py", values)]


def _adjoint(program: Program, adjoint: Adjoint) -> list[str]:
    """The transpose of steps, with what it needs."""
    step, values, parts = program.step, _values(program), ["newton"]
    kernels = [_with_level(k) if k is adjoint.prepare else k for k in adjoint.kernels]
    if isinstance(step, Explicit):
        parts = ["explicit"]
    if isinstance(step, Splitting):
        values |= _splitting_values(step) | {"kicks": bool(step.schedule.multiples)}
        values["adjoints"] = ", ".join(f"_{kernel.name}" for kernel in adjoint.steps)
        parts = ["splitting"]
    if adjoint.path and isinstance(step, Path):
        values |= _varied(program, step, adjoint.path)
        kernels += [] if program.extras.tangent else [adjoint.path.curvature]
        parts = ["piece", "path"]
    kernels += [program.monitor.level] if program.monitor and program.monitor.level else []
    values |= _of_pullback(program, step)
    parts = [*parts, *(["early"] if step.refresh else []), "run", "parameters"]
    pieces = [_function(program, kernel) for kernel in kernels]
    pieces += [render("numpy", f"adjoint_{part}.py", values) for part in parts]
    return [*pieces, render("numpy", "pullback.py", values)]


def _varied(program: Program, step: Path, adjoint: PathAdjoint) -> dict[str, object]:
    """A path with its derivatives along its start, p and the coefficients that π depends on, column by column."""
    path, slopes, n = step.recurrences, adjoint.slopes, program.dimension
    whole = Recurrences((*path.series, *slopes.series), path.slopes, (*path.fixed, *slopes.fixed))
    along_p = [(e.row, n + e.column, e.series, True) for e in slopes.tensor]
    along_c = [(e.row, 2 * n + e.column, e.series, False) for e in slopes.along]
    return {
        **statements(program, whole, PATH_SYNTAX),
        "series": len(whole.series),
        "width": 2 * n + len(adjoint.used),
        "used": repr(list(adjoint.used)),
        "jacobian": [(e.row, e.column, e.series) for e in slopes.jacobian],
        "sources": [*along_p, *along_c],
    }


def _with_level(prepare: Kernel) -> Kernel:
    """The transpose of ``prepare`` with a second result, which is empty where no e is held."""
    return replace(prepare, outputs=(*prepare.outputs, Output("gauge_bar", ()))[:2])


def _of_pullback(program: Program, step: Step) -> dict[str, object]:
    """What the templates of whole runs read."""
    rows = len(step.schedule.times) if isinstance(step, Splitting) else 1
    moment = ", t0 + done * h, h" if isinstance(step, Splitting) else ""
    said = "the e of a trajectory follows x0\n    and the parameters, unless a gauge is given."
    return {
        "parameters": len(program.parameters),
        "levels": int(program.monitor is not None),
        "early": step.prepared * rows,
        "gauge_passed": "gauge.T, " * bool(program.held),
        "t0_too": ", t0" * bool(program.time),
        "found": f"_early(stage, found{moment})" if step.refresh else "found",
        "said_of_level": said if program.monitor else "a gauge is held fixed.",
    }


def _attitude(program: Program, attitude: Attitude) -> list[str]:
    """Attitudes: the kernels, and their use."""
    group, step, rows = attitude.group, program.step, attitude.group.rows
    solved = "_path(stage[0], x, solved)[1]" if isinstance(step, Path) else "solved"
    shown = f"Attitudes have shape (rows, ..., {rows}, {rows})" if rows else "Attitudes have shape (rows, ..., 4)"
    values = {
        **_values(program),
        "size": group.size,
        "what": f"matrix of {rows} rows" if rows else "quaternion" + " and a position" * bool(group.translation),
        "rows": rows,
        "position": bool(group.translation),
        "exponential": attitude.exponential is not None,
        "uniform": attitude.rate is not None,
        "normalise": group.orthogonal,
        "splitting": isinstance(step, Splitting),
        "rates": f"_rate(parameters, {'gauge.T, ' * bool(program.gauge)}x)" if attitude.rate else "None",
        "turn_of_stage": _turn_of_stage(attitude, solved),
        "lengthened": attitude.lengthened,
        "turn_of_flows": "_shorter(turn)" if attitude.lengthened else "turn",
        "shaped": _shaped(rows, bool(group.translation)),
        **_ordered(group.spatial),
        "shapes": shown + ", positions (rows, ..., 3)" * bool(group.translation),
    }
    turns = "TURNS = (" + ", ".join(f"_turn{k}" for k in range(1, len(attitude.turns) + 1)) + ",)\n"
    unused = attitude.turn if attitude.along else attitude.along
    pieces = [_function(program, kernel) for kernel in attitude.kernels if kernel is not unused]
    pieces += [turns] if attitude.turns else []
    own = ("matrices", "matrix_start") if rows else ("quaternions", "rotations", "start")
    parts = [*(f"attitude_{part}" for part in own), "attitude", "reconstruct"]
    return [*pieces, *(render("numpy", f"{part}.py", values) for part in parts)]


def _turn_of_stage(attitude: Attitude, solved: str) -> str:
    """The factors of a stage, less 1."""
    turn = "_along(solved)" if attitude.along else f"_turn(stage[0], x + {solved})"
    return f"_of_covector({turn})" if attitude.group.matrices and not attitude.cayley else turn


def _shaped(rows: int, position: bool) -> str:
    """The arrays that users get of rows of elements."""
    if rows:
        return f"elements.reshape(shape + ({rows}, {rows}))"
    if not position:
        return "elements.reshape(shape + (4,))"
    return "elements[..., :4].reshape(shape + (4,)), elements[..., 4:].reshape(shape + (3,))"


def _ordered(spatial: bool) -> dict[str, str]:
    """Factors of products: later ones stand on the left where momenta are in space."""
    pairs = {
        "uniform_first": ("first", "_uniform(rate, t)"),
        "element_first": ("first", "element"),
        "factor_element": ("element", "factor"),
        "quaternions": ("element[..., :4]", "turn[..., :4]"),
    }
    moved = "turn + np.eye(1, ELEMENT), element[..., 4:]" if spatial else "element, turn[..., 4:]"
    return {"moved": moved} | {name: ", ".join(p[::-1] if spatial else p) for name, p in pairs.items()}


def _values(program: Program) -> dict[str, object]:
    """What the templates read that are not of one part of the module only."""
    said = {"title": plain(program.about.title) or program.name, **facts(program, listed, quoted)}
    return {**said, **_of_fixed(program), **_of_time(program), **_of_noise(program), **_of_step(program)}


def _of_fixed(program: Program) -> dict[str, object]:
    """What a trajectory holds fixed, and steps in tau."""
    return {
        "gauge": listed(program.held),
        "monitored": program.monitor is not None,
        "said_of_tau": _OF_TAU * bool(program.monitor),
        "said_of_gauge": _OF_LEVEL if program.monitor else _OF_GAUGE,
        "prepare_arguments": "values, np.zeros((len(GAUGE), 1)), 1e-100" if program.held else "values, 1e-100",
    }


def _of_time(program: Program) -> dict[str, object]:
    """Where H depends on the time: arguments, and what is said of them."""
    time = bool(program.time)
    return {
        "time": time,
        "at_t": "t, " * time,
        "t0_given": ", t0=0.0" * time,
        "t0_passed": ", t0=t0" * time,
        "said_from_t0": ", from the time t0" * time,
        "said_of_t0": " t0 is the time of x0." * time,
        "said_of_each": "h, t0 and parameters" if time else "h and parameters",
    }


def _of_step(program: Program) -> dict[str, object]:
    """The kind of step, its coefficients and stages, and by what its equation is solved."""
    step = program.step
    inner = step.inner if isinstance(step, Implicit) else InnerSolve()
    return {
        "path": isinstance(step, Path),
        "splitting": isinstance(step, Splitting),
        "renewed": step.renewed,
        "prepared": step.prepared,
        "moments": listed(step.schedule.moments) if isinstance(step, Splitting) and step.refresh else "",
        "middles": listed(program.midpoints),
        "fractions": listed(program.fractions),
        "plausible": repr(PLAUSIBLE),
        "max_iterations": inner.max_iterations,
        "tolerance": repr(inner.tolerance),
        # The floor of the scale of a component: see _size.
        "floor": "0.0" if inner.relative else "1e-6",
        "path_pieces": repr(tuple(1 << k for k in range(LONGEST_PATH.bit_length()))),
        "most_pieces": MOST_PIECES,
        "terms": TERMS,
        "series": len(step.recurrences.series) if isinstance(step, Path) else 0,
    }


def _of_noise(program: Program) -> dict[str, object]:
    """What depends on whether coefficients are those of a single step, with its time or its noise."""
    noise = program.noise
    renewed, drawn = bool(program.time or noise), ["drawn(done)"] if noise else []
    now = ", ".join(["s", "t0 + done * h" if program.time else "done * h", "h", *drawn])
    first = ["float(t0)" if program.time else "0.0", "float(h)"]
    first += ["_drawing(float(h), len(x), seed, member, step0, increments)(0)"] if noise else []
    named = ("seed", "member", "step0", "increments")
    return {
        "noise_given": ", seed=0, member=0, step0=0, increments=None" * bool(noise),
        "noise_passed": "".join(f", {name}={name}" for name in named) * bool(noise),
        "said_of_noise": _NOISE_ARGUMENTS * bool(noise),
        "of_stage": ", ".join(["_, parameters, h", *(["t"] if program.time else []), *(["dw"] if noise else [])]),
        "stages_now": f"[_renewed({now}) for s in stages]" if renewed else "stages",
        "renewed_stage": f"            stage = _renewed({', '.join(['stage', *first])})\n" if renewed else "",
    }


def _function(program: Program, kernel: Kernel) -> str:
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
    """The argument that holds states (..., DIM), which arrays are shaped by; empty where there is none."""
    others = [a for a in kernel.inputs if a not in (TABLE, "params", "gauge", *SCALARS)]
    return next((a for a in others if not isinstance(kernel.inputs[a][0], Symbol)), "")


def _list(items: Sequence[str]) -> str:
    text = "[" + ", ".join(items) + "]"
    if len(text) < 90:
        return text
    return "[\n" + "".join(f"            {i},\n" for i in items) + "        ]"
