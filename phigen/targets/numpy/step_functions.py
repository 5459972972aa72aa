"""The text of steps in NumPy: a record for each kind of step, which `phigen.targets.numpy.emitter` inserts into
modules.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from phigen.ir import nodes as ir
from phigen.ir.path_functions import PathFunctions, PathLayout, tangent_program
from phigen.scheme.kernel import Kernel
from phigen.scheme.path import Recurrences
from phigen.scheme.program import Program
from phigen.scheme.steps import Explicit, Gauss, Newton, Path, PathAdjoint, Splitting
from phigen.targets.numpy.kernels import function
from phigen.targets.numpy.language import listed
from phigen.targets.numpy.loops import statements
from phigen.targets.numpy.values import values_of
from phigen.targets.rendering import render


class _PathOverMembers(PathLayout):
    """The names of the arrays that hold the values of a path, for several members at once.

    An array has the values of one quantity for all members. A Taylor series is a list with one array for each order.
    """

    def covector(self, i: int) -> ir.Value:
        """Return component i of the covector p, for all members."""
        return ir.Entry(ir.fixed("p"), ir.Several((ir.fixed(":"), ir.Constant(i))))

    def fixed(self, i: int) -> ir.Value:
        """Return the variable for one of the values that are constant along a path; ``i`` is the number of the
        value.
        """
        return ir.fixed(f"f{i}")

    def following(self, i: int, k: ir.Value, value: ir.Value) -> ir.Statement:
        """Return the statement that appends the coefficient of order k to a series. Coefficients of order 0 are
        converted to arrays.
        """
        first = k == ir.Constant(0)
        return ir.Append(self.series(i), ir.Binary("+", value, ir.Constant(0.0)) if first else value)


def _path_lines(program: Program, path: Recurrences) -> dict[str, list[str]]:
    """Return the statements that compute a path ṁ = π(m)p by Taylor series: lines of text, by the name of the block
    that they belong to.
    """
    blocks = PathFunctions(program, path, _PathOverMembers()).blocks()
    printed = {name: statements(function)[1] for name, function in blocks.items()}
    return {name: [line.strip() for line in lines] for name, lines in printed.items()}


@dataclass(frozen=True)
class StepPart:
    """Kernels of a step, the templates of functions that call them, and additional ``values`` for these templates."""

    kernels: Sequence[Kernel | None] = ()
    templates: Sequence[str] = ()
    values: Mapping[str, object] = field(default_factory=dict)

    def functions(self, program: Program) -> list[str]:
        """Return the kernels as the text of Python functions that use NumPy."""
        return [function(program, kernel) for kernel in self.kernels if kernel]

    def rendered(self, program: Program, prefix: str = "") -> list[str]:
        """Return the rendered templates. The names of their files are ``prefix`` followed by the names in
        ``templates``.
        """
        values = {**values_of(program), **self.values}
        return [render("numpy", f"{prefix}{part}.py", values) for part in self.templates]


@dataclass(frozen=True)
class StepFunctions:
    """The functions of one kind of step: a stage, its tangent map, and its transpose.

    ``adjoint`` has the additional kernels that the transpose needs. ``chained`` says that the iteration for the
    transpose of a step starts from the solution for the following step.
    """

    stage: Callable[[Program, Any], StepPart]
    tangent: Callable[[Program, Any], StepPart]
    adjoint: Callable[[Program, Any], StepPart]
    chained: bool = False


def _prediction(program: Program) -> str:
    return "anew" if program.noise else "prediction"


def _newton(program: Program, step: Newton) -> StepPart:
    return StepPart(
        (step.prepare, step.refresh, step.linearise), ("solve", "plausible", "newton", f"newton_{_prediction(program)}")
    )


def _explicit(program: Program, step: Explicit) -> StepPart:
    return StepPart((step.prepare, step.refresh, step.increment), ("explicit",))


def _path(program: Program, step: Path) -> StepPart:
    templates = (
        "holds",
        "piece",
        "path",
        "residual",
        "solve",
        "plausible",
        "path_step",
        f"path_{_prediction(program)}",
    )
    values = _path_lines(program, step.recurrences)
    return StepPart((step.prepare, step.refresh, step.generate), templates, values)


def _path_tangent(program: Program, step: Path) -> StepPart:
    if step.tangent is None:
        return StepPart()
    extended, path = tangent_program(program), step.tangent.recurrences
    values = {**_path_lines(extended, path), "series": len(path.series), "n_twice": extended.dimension}
    return StepPart((step.tangent.curvature,), ("holds", "piece", "seeds", "path"), values)


def _path_adjoint(program: Program, step: Path) -> StepPart:
    if step.back is None:
        return StepPart(templates=("newton",))
    kernels = () if program.extras.tangent else (step.back.curvature,)
    return StepPart(kernels, ("piece", "path"), _varied(program, step, step.back))


def _varied(program: Program, step: Path, adjoint: PathAdjoint) -> dict[str, object]:
    """Return template values: the recurrences for a path and for its derivatives. The derivatives are computed column
    by column.

    The path is differentiated with respect to three arguments: the start of the path, the covector p, and the
    coefficients that π depends on.
    """
    path, slopes, n = step.recurrences, adjoint.slopes, program.dimension
    whole = Recurrences((*path.series, *slopes.series), path.slopes, (*path.fixed, *slopes.fixed))
    along_p = [(e.row, n + e.column, e.series, True) for e in slopes.tensor]
    along_c = [(e.row, 2 * n + e.column, e.series, False) for e in slopes.along]
    return {
        **_path_lines(program, whole),
        "series": len(whole.series),
        "width": 2 * n + len(adjoint.used),
        "used": repr(list(adjoint.used)),
        "jacobian": [(e.row, e.column, e.series) for e in slopes.jacobian],
        "sources": [*along_p, *along_c],
    }


def _gauss(program: Program, step: Gauss) -> StepPart:
    return StepPart((step.prepare, step.refresh, step.slope, step.change, step.frame), ("gauss",), _gauss_values(step))


def _gauss_tangent(program: Program, step: Gauss) -> StepPart:
    kernels = (step.tangent.slope, step.tangent.change) if step.tangent else ()
    return StepPart(kernels, ("gauss",) if step.tangent else (), _gauss_values(step))


def _gauss_adjoint(program: Program, step: Gauss) -> StepPart:
    stored = 2 * program.dimension + step.unknowns * step.tableau.stages
    return StepPart((), ("gauss",), {**_gauss_values(step), "of_step": stored})


def _gauss_values(step: Gauss) -> dict[str, object]:
    return {
        "nodes": listed(step.tableau.nodes),
        "weights": listed(step.tableau.weights),
        "mixing": [", ".join(map(repr, row)) for row in step.tableau.mixing],
        "framed": step.frame is not None,
        "plain": step.plain,
        "unknowns": step.unknowns,
        "most_sweeps": step.most_sweeps,
    }


def _splitting(program: Program, step: Splitting) -> StepPart:
    row, rows = replace(step.prepare, name="prepare_row"), "rows_kicks" if step.multiples else "rows"
    return StepPart((row, step.refresh, *step.flows), ("splitting", rows), _splitting_values(step))


def _splitting_adjoint(program: Program, step: Splitting) -> StepPart:
    names = ", ".join(f"_{kernel.name}" for kernel in step.adjoint.steps) if step.adjoint else ""
    values = {**_splitting_values(step), "kicks": bool(step.multiples), "adjoints": names}
    return StepPart((), ("splitting",), values)


def _splitting_values(step: Splitting) -> dict[str, object]:
    schedule, numbers = step.schedule, range(1, len(step.flows) + 1)
    return {
        "times": listed(schedule.times),
        "multiples": listed(schedule.multiples),
        "row": step.row,
        "schedule": repr(tuple(schedule.flows)),
        "begin": repr(schedule.begin),
        "end": repr(schedule.end),
        "flows": ", ".join(f"_flow{k}" for k in numbers),
        "tangents": ", ".join(f"_tangent{k}" for k in numbers),
    }


#: The parts of a module that depend on the kind of step, for each kind. `phigen.targets.numpy.lattice_module` prints
#: the modules of lattices.
STEP_FUNCTIONS: Mapping[str, StepFunctions] = {
    "newton": StepFunctions(
        stage=_newton,
        tangent=lambda program, step: StepPart(templates=("newton",)),
        adjoint=lambda program, step: StepPart(templates=("newton",)),
    ),
    "explicit": StepFunctions(
        stage=_explicit,
        tangent=lambda program, step: StepPart((step.tangent,), ("explicit",)),
        adjoint=lambda program, step: StepPart(templates=("explicit",)),
    ),
    "path": StepFunctions(stage=_path, tangent=_path_tangent, adjoint=_path_adjoint),
    "gauss": StepFunctions(
        stage=_gauss,
        tangent=_gauss_tangent,
        adjoint=_gauss_adjoint,
        chained=True,
    ),
    "splitting": StepFunctions(
        stage=_splitting,
        tangent=lambda program, step: StepPart(step.tangents, ("splitting",), _splitting_values(step)),
        adjoint=_splitting_adjoint,
    ),
}


def functions_of(program: Program) -> StepFunctions:
    """Return the entry of `STEP_FUNCTIONS` for the step of a program. Raises `KeyError` for a lattice."""
    return STEP_FUNCTIONS[program.step.kind.name]
