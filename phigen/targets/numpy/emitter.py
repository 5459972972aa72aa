"""A program as a Python module: `NAME.py`."""

from __future__ import annotations

from dataclasses import replace

from phigen.scheme.kernel import Kernel, Output
from phigen.scheme.program import Program
from phigen.scheme.steps import Adjoint, Step
from phigen.targets.header import header_lines, sealed
from phigen.targets.numpy import attitude, functions
from phigen.targets.numpy.kernels import function
from phigen.targets.numpy.step_functions import StepPart, functions_of
from phigen.targets.numpy.values import values_of
from phigen.targets.rendering import render


def emit(program: Program, command: str) -> dict[str, str]:
    """Return the generated file by its name. Its header says that ``command`` regenerates it."""
    body = _body(program)
    return {f"{program.name}.py": sealed(header_lines(program, command), body, "# ", "", "")}


def _body(program: Program) -> str:
    """Return the text of the module without its header comment."""
    if step := program.step.swept:
        from phigen.targets.numpy import lattice_module

        early = [step.prepare, step.refresh]
        early += [step.adjoint.prepare, step.adjoint.refresh] if step.adjoint else []
        return lattice_module.body(program, step, "\n\n".join(function(program, kernel) for kernel in early if kernel))
    pieces = [render("numpy", part, values_of(program)) for part in ("preamble.py", "arrays.py", "parameters.py")]
    pieces += functions.called(program)
    stage = functions_of(program).stage(program, program.step)
    pieces += [*stage.functions(program), *stage.rendered(program)]
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


def _monitor(program: Program) -> list[str]:
    """Return the functions that compute the physical time of steps; [] without a monitor."""
    if not program.monitor:
        return []
    kernels = [k for k in (program.monitor.elapsed, program.monitor.rate) if k]
    return [*(function(program, kernel) for kernel in kernels), render("numpy", "elapsed.py", values_of(program))]


def _tangent(program: Program) -> list[str]:
    """Return the functions of the tangent map of a step."""
    part = functions_of(program).tangent(program, program.step)
    values = {**values_of(program), **part.values}
    return [*part.functions(program), *part.rendered(program, "tangent_"), render("numpy", "tangent.py", values)]


def _adjoint(program: Program, adjoint: Adjoint) -> list[str]:
    """Return the functions of the reverse pass."""
    step, level = program.step, program.monitor.level if program.monitor else None
    part = functions_of(program).adjoint(program, step)
    kernels = [_with_level(k) if k is adjoint.prepare else k for k in adjoint.kernels]
    templates = [*part.templates, *(["early"] if step.refresh else []), "run", "parameters"]
    values = {**_of_pullback(program, step), **part.values}
    whole = StepPart([*kernels, *part.kernels, level], templates, values)
    pullback = render("numpy", "pullback.py", {**values_of(program), **values})
    return [*whole.functions(program), *whole.rendered(program, "adjoint_"), pullback]


def _with_level(prepare: Kernel) -> Kernel:
    """Return ``prepare``, a transposed kernel, with exactly two outputs. The second output is the cotangent of the
    energy level e, or an empty list if the program has no energy level.
    """
    return replace(prepare, outputs=(*prepare.outputs, Output("gauge_bar", ()))[:2])


def _of_pullback(program: Program, step: Step) -> dict[str, object]:
    """Return the values for the templates of the reverse pass through a step."""
    rows = len(step.flow_schedule.times) if step.flow_schedule else 1
    moment = ", t0 + done * h, h" if step.flow_schedule else ""
    said = "the energy level e is\n    computed from x0 and the parameters, unless the argument gauge sets e."
    return {
        "parameters": len(program.parameters),
        "levels": int(program.monitor is not None),
        "early": step.prepared * rows,
        "of_step": 3 * program.dimension,
        "gauge_passed": "gauge.T, " * bool(program.held),
        "t0_too": ", t0" * bool(program.time),
        "chained": functions_of(program).chained,
        "coef_slopes": f"_early(stage, slopes{moment})" if step.refresh else "slopes",
        "said_of_level": said if program.monitor else "a gauge is held fixed.",
    }
