"""The parts of JavaScript modules that depend on the kind of step. The functions of a `StepModule` return these parts,
and `phigen.targets.js.emitter` inserts the parts into modules.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from phigen.ir.path_functions import TERMS, PathFunctions, PathLayout, tangent_program
from phigen.scheme.kernel import Kernel
from phigen.scheme.path import Recurrences
from phigen.scheme.program import Attitude, Program
from phigen.scheme.steps import Explicit, Gauss, Newton, Path, Splitting
from phigen.targets.js.loops import statements
from phigen.targets.rendering import render


@dataclass(frozen=True)
class StepModule:
    """The parts of a module that depend on the kind of step. Each part is a function that receives the program and the
    step.

    ``constants`` are printed before the kernels, and ``series``, the recurrences for paths, after the kernels.
    ``kernels`` are the kernels that the runtime calls. If the program has attitudes, kernels of attitudes may replace
    some of them. `phigen.targets.js.files` lists the modules of the runtime for each kind.
    """

    kernels: Callable[[Program, Any], Sequence[Kernel | None]]
    constants: Callable[[Program, Any], list[str]] = lambda program, step: []
    series: Callable[[Program, Any], list[str]] = lambda program, step: []


def _implicit(step: Newton | Path) -> list[str]:
    """Return the declarations of the constants that an implicit step needs.

    Steps along a path have more constants: how many Taylor series the path and its derivatives have.
    """
    path, varied = step.path, step.varied_path
    return [
        render(
            "js",
            "implicit.mjs",
            {
                "max_iterations": step.inner.max_iterations,
                "tolerance": repr(step.inner.tolerance),
                "newton": path is None,
                "series": len(path.series) if path else 0,
                "fixed": len(path.fixed) if path else 0,
                "tangent_series": len(varied.series) if varied else 0,
                "tangent_fixed": len(varied.fixed) if varied else 0,
                "terms": TERMS,
            },
        )
    ]


def _path_series(program: Program, step: Path) -> list[str]:
    varied = [_path(tangent_program(program), step.tangent.recurrences, "tangent")] if step.tangent else []
    return [_path(program, step.recurrences, "path"), *varied]


def _path(program: Program, path: Recurrences, kind: str) -> str:
    """Return the text of the recurrences for a path. If ``kind`` is "tangent", they also compute the variation of the
    path.
    """
    blocks = PathFunctions(program, path, PathLayout()).blocks()
    lines = {name: [line.removeprefix("  ") for line in statements(function)] for name, function in blocks.items()}
    return render("js", "path.mjs", {**lines, "kind": kind, "varied": kind == "tangent"})


def _path_kernels(program: Program, step: Path) -> Sequence[Kernel | None]:
    return [step.prepare, step.refresh, step.main, step.tangent.curvature if step.tangent else None]


def _explicit_kernels(program: Program, step: Explicit) -> Sequence[Kernel | None]:
    return [step.prepare, step.refresh, step.main, step.tangent]


def _collocation(program: Program, step: Gauss) -> list[str]:
    """Return lines of code that declare the coefficients of a Gauss method."""
    table = step.tableau
    values = {
        "unknowns": step.unknowns,
        "plain": step.plain,
        "point": program.dimension + bool(program.time),
        "most_sweeps": step.most_sweeps,
        "nodes": json.dumps(table.nodes),
        "weights": json.dumps(table.weights),
        "mixing": [json.dumps(row) for row in table.mixing],
    }
    return [render("js", "gauss.mjs", values)]


def _schedule(step: Splitting, attitude: Attitude | None) -> list[str]:
    """Return lines of code that declare the order and the durations of the flows in a step."""
    schedule = step.schedule
    values = {
        "times": json.dumps(schedule.times),
        "multiples": json.dumps(schedule.multiples) if schedule.multiples else "",
        "schedule": json.dumps(schedule.flows),
        "begin": json.dumps(schedule.begin) if schedule.begin else "",
        "end": json.dumps(schedule.end),
        "flows": _numbered("turn", attitude.turns) if attitude else _numbered("flow", step.flows),
        "tangents": _numbered("tangent", step.tangents),
    }
    return [render("js", "schedule.mjs", values)]


def _numbered(name: str, kernels: Sequence[Kernel]) -> str:
    return ", ".join(f"{name}{k}" for k in range(1, len(kernels) + 1))


def _splitting_kernels(program: Program, step: Splitting) -> Sequence[Kernel | None]:
    flows = program.attitude.turns if program.attitude else step.flows
    return [replace(step.prepare, name="prepare_row"), step.refresh, *flows, *step.tangents]


#: The parts of a module that depend on the kind of step, for each kind. `phigen.targets.js.lattice_tables` prints the
#: modules of lattices.
STEP_MODULES: Mapping[str, StepModule] = {
    "newton": StepModule(
        kernels=lambda program, step: [step.prepare, step.refresh, step.main],
        constants=lambda program, step: _implicit(step),
    ),
    "explicit": StepModule(kernels=_explicit_kernels),
    "path": StepModule(
        kernels=_path_kernels,
        constants=lambda program, step: _implicit(step),
        series=_path_series,
    ),
    "gauss": StepModule(kernels=lambda program, step: replace(step, lifted=None).kernels, constants=_collocation),
    "splitting": StepModule(
        kernels=_splitting_kernels,
        constants=lambda program, step: _schedule(step, program.attitude),
    ),
}
