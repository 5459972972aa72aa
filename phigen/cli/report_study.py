"""Errors as functions of step and time for ``phigen report``, and the machine on which they were measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from phigen.cli.console import Console

if TYPE_CHECKING:
    from phigen.cli.experiment import Experiment
    from phigen.compilation import Compilation
    from phigen.runtime.interface import Floats
    from phigen.study.precision import Study

#: Number of repetitions of each time measurement, by default and with --quick.
_ROUNDS, _FEW_ROUNDS = 5, 2
#: Largest number of steps over which --quick measures errors. Without --quick, errors are measured over the whole run.
_FEW_STEPS = 256
#: File in which Linux names the processor.
_PROCESSOR = Path("/proc/cpuinfo")


def studied(
    compilation: Compilation, experiment: Experiment, quick: bool, console: Console
) -> tuple[Study | None, str]:
    """Return two values: the study of precision and time, or None; and the reason why there is no study, or ""."""
    import numpy as np

    from phigen.api import solver_of
    from phigen.runtime import toolchain
    from phigen.study import precision, race
    from phigen.study.classical import COMPARED

    if compilation.system.noise:
        return None, "Errors against step and time are not measured with noise; the strong order is above."
    run, x0 = experiment.run, np.array(experiment.initial)
    methods = list(dict.fromkeys([*(run.compare or COMPARED), "dop853"]))
    console.note(f"{compilation.spec.name}: measuring errors and times")
    if toolchain.available():
        compared = race.compiled(compilation, methods, x0, experiment.parameters, experiment.t0)
    else:
        compared = race.interpreted(solver_of(compilation, "numpy"), methods, x0, experiment.parameters, experiment.t0)
    steps = min(run.steps, _FEW_STEPS) if quick else run.steps
    solution, casimirs = _closed_form(compilation, experiment, x0), _casimirs(compilation, experiment, x0)
    rounds = _FEW_ROUNDS if quick else _ROUNDS
    try:
        study = precision.study(
            compared, compilation.order.order, experiment.h, steps, solution, casimirs, rounds=rounds
        )
    except ArithmeticError as error:
        return None, f"Errors against step and time could not be measured: {error}."
    return study, ""


def _closed_form(compilation: Compilation, experiment: Experiment, x0: Floats) -> Callable[[float], Floats] | None:
    """Return the closed form of the solution, as a function of the time since the start of the run.

    The result is None if the spec does not state the closed form of every coordinate, or if there is a monitor. With a
    monitor, steps are not equal in t.
    """
    import numpy as np

    from phigen.study.summary import exact_solution

    system, run = compilation.system, experiment.run
    if set(run.exact) != set(system.coordinates) or compilation.program.monitor is not None:
        return None

    def solution(t: float) -> Floats:
        values = exact_solution(system, run, experiment.parameters, x0, np.array([experiment.t0 + t]))
        return np.array([float(values[c][0]) for c in system.coordinates])

    return solution


def _casimirs(compilation: Compilation, experiment: Experiment, x0: Floats) -> Callable[[Floats], float] | None:
    """Return a function that maps a state to the largest relative change of a Casimir from its value at x0.

    The changes are relative to the sizes that `phigen.geometry.conservation.units` returns. For systems without
    Casimirs the result is None.
    """
    from phigen.geometry.conservation import units
    from phigen.study.precision import ROUNDING
    from phigen.symbolic.arrays import evaluate

    system = compilation.system
    formulas = list(system.casimirs.values())
    if not formulas:
        return None

    def at(x: Floats) -> Mapping[str, float]:
        return {**experiment.parameters, **dict(zip(system.coordinates, x.tolist(), strict=True))}

    start = evaluate(formulas, at(x0))
    sizes = [unit.size for unit in units(formulas, system.coordinates, experiment.parameters, x0)]

    def worst(x: Floats) -> float:
        values = evaluate(formulas, at(x))
        return max(ROUNDING, *(abs(float(v - s)) / size for v, s, size in zip(values, start, sizes, strict=True)))

    return worst


def environment() -> dict[str, str]:
    """Return those properties of the machine that influence measured times, by name."""
    import platform

    from phigen.runtime import toolchain

    try:
        lines = _PROCESSOR.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    processor = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")
    compiler = toolchain.find().version if toolchain.available() else f"none; Python {platform.python_version()}"
    return {"times were measured on": processor or platform.machine(), "with the C compiler": compiler}
