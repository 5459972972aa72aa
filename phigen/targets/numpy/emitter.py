"""A program as a Python module: `NAME.py`."""

from __future__ import annotations

from dataclasses import replace

from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.path import Recurrences
from phigen.scheme.program import Program
from phigen.scheme.steps import (
    Adjoint,
    Explicit,
    Gauss,
    Newton,
    Path,
    PathAdjoint,
    Splitting,
    Step,
    Sweeps,
)
from phigen.targets.header import header_lines, sealed
from phigen.targets.numpy import attitude, functions
from phigen.targets.numpy.kernels import function
from phigen.targets.numpy.language import LANGUAGE, listed
from phigen.targets.numpy.values import values_of
from phigen.targets.path import Syntax, statements, tangent_program
from phigen.targets.rendering import render

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
        return lattice.body(program, program.step, "\n\n".join(function(program, kernel) for kernel in early if kernel))
    pieces = [render("numpy", part, values_of(program)) for part in ("preamble.py", "arrays.py", "parameters.py")]
    pieces += functions.called(program)
    pieces += _step(program)
    search = ("gauge_line.py", "gauge.py") if program.searches_gauge else ("gauge_formula.py",)
    templates = search if program.gauge else ("level.py",) if program.monitor else ("no_gauge.py",)
    pieces += [render("numpy", template, values_of(program)) for template in templates]
    pieces += [function(program, kernel) for kernel in program.choice]
    pieces += _monitor(program)
    coefficients = ["coefficients_in_time.py" if program.time else "coefficients.py"]
    if program.noise:
        coefficients = ["noise.py", "philox.py", "normals.py", "drawing.py", "renewed.py"]
    parts = (*coefficients, "single.py", "checked.py", "integrate.py")
    pieces += [render("numpy", part, values_of(program)) for part in parts]
    pieces += [function(program, kernel) for kernel in program.observables.kernels]
    pieces += [function(program, program.noise.fields)] if program.noise and program.noise.fields else []
    pieces += [render("numpy", "observables.py", values_of(program))]
    if program.extras.tangent:
        pieces += _tangent(program)
    if program.step.adjoint:
        pieces += _adjoint(program, program.step.adjoint)
    if program.attitude:
        pieces += attitude.pieces(program, program.attitude)
    if program.modified:
        values = {
            "modified_power": program.modified.power,
            "t_given": ", t" * bool(program.time),
            "said_at_t": " at the time t" * bool(program.time),
            "t_passed": ", np.asarray(t, dtype=float)" * bool(program.time),
        }
        pieces += [function(program, program.modified.kernel), render("numpy", "modified.py", values)]
    return "\n\n".join(p.strip("\n") + "\n" for p in pieces)


def _step(program: Program) -> list[str]:
    """The functions that make a stage."""
    values = values_of(program)

    def rendered(*parts: str) -> list[str]:
        return [render("numpy", f"{part}.py", values) for part in parts]

    refresh, prepare = program.step.refresh, program.step.prepare
    renewing = [function(program, refresh)] if refresh else []
    early = [function(program, prepare), *renewing]
    guess = "anew" if program.noise else "guess"
    match program.step:
        case Splitting(flows=flows, schedule=schedule) as step:
            values |= _splitting_values(step)
            row = function(program, replace(prepare, name="prepare_row"))
            rows = "rows_kicks" if schedule.multiples else "rows"
            return [row, *renewing, *(function(program, flow) for flow in flows), *rendered("splitting", rows)]
        case Explicit(increment=increment):
            return [*early, function(program, increment), *rendered("explicit")]
        case Path(recurrences=path, generate=generate):
            values |= statements(program, path, PATH_SYNTAX)
            parts = rendered("holds", "piece", "path", "residual", "solve", "plausible", "path_step", f"path_{guess}")
            return [*early, function(program, generate), *parts]
        case Newton(linearise=linearise):
            parts = rendered("solve", "plausible", "newton", f"newton_{guess}")
            return [*early, function(program, linearise), *parts]
        case Gauss(slope=slope, change=change) as step:
            values |= _gauss_values(step)
            kernels = [slope, change, *([step.frame] if step.frame else [])]
            return [*early, *(function(program, kernel) for kernel in kernels), *rendered("gauss")]
        case Sweeps():
            raise AssertionError("lattices have a module of their own")


def _monitor(program: Program) -> list[str]:
    """The time that steps take, of a monitored solver."""
    if not program.monitor:
        return []
    kernels = [k for k in (program.monitor.elapsed, program.monitor.rate) if k]
    return [*(function(program, kernel) for kernel in kernels), render("numpy", "elapsed.py", values_of(program))]


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


def _gauss_values(step: Gauss) -> dict[str, object]:
    return {
        "weights": listed(step.tableau.weights),
        "mixing": [", ".join(map(repr, row)) for row in step.tableau.mixing],
        "prediction": [", ".join(map(repr, row)) for row in step.tableau.prediction],
        "framed": step.frame is not None,
        "plain": step.plain,
        "unknowns": step.unknowns,
        "most_sweeps": step.most_sweeps,
    }


def _tangent(program: Program) -> list[str]:
    """The tangent map of a step, with what it needs."""
    values, kernels, parts = values_of(program), list[Kernel](), list[str]()
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
        case Gauss(tangent=varied_stage) as step if varied_stage:
            values |= _gauss_values(step)
            kernels, parts = [varied_stage.slope, varied_stage.change], ["gauss"]
        case Newton():
            parts = ["newton"]
    pieces = [function(program, kernel) for kernel in kernels]
    pieces += [render("numpy", f"tangent_{part}.py", values) for part in parts]
    return [*pieces, render("numpy", "tangent.py", values)]


def _adjoint(program: Program, adjoint: Adjoint) -> list[str]:
    """The transpose of steps, with what it needs."""
    step, values, parts = program.step, values_of(program), ["newton"]
    kernels = [_with_level(k) if k is adjoint.prepare else k for k in adjoint.kernels]
    if isinstance(step, Explicit):
        parts = ["explicit"]
    if isinstance(step, Splitting):
        values |= _splitting_values(step) | {"kicks": bool(step.schedule.multiples)}
        values["adjoints"] = ", ".join(f"_{kernel.name}" for kernel in adjoint.steps)
        parts = ["splitting"]
    if isinstance(step, Gauss):
        values |= _gauss_values(step)
        parts = ["gauss"]
    if adjoint.path and isinstance(step, Path):
        values |= _varied(program, step, adjoint.path)
        kernels += [] if program.extras.tangent else [adjoint.path.curvature]
        parts = ["piece", "path"]
    kernels += [program.monitor.level] if program.monitor and program.monitor.level else []
    values |= _of_pullback(program, step)
    parts = [*parts, *(["early"] if step.refresh else []), "run", "parameters"]
    pieces = [function(program, kernel) for kernel in kernels]
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
        "kept": 2 * program.dimension
        + (step.unknowns * step.tableau.stages if isinstance(step, Gauss) else program.dimension),
        "gauge_passed": "gauge.T, " * bool(program.held),
        "t0_too": ", t0" * bool(program.time),
        "found": f"_early(stage, found{moment})" if step.refresh else "found",
        "said_of_level": said if program.monitor else "a gauge is held fixed.",
    }
