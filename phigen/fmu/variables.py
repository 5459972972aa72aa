"""Variables of an FMU: quantities of the solver that the simulator reads and sets by their numbers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain
from typing import TYPE_CHECKING

from phigen.errors import SpecError

if TYPE_CHECKING:
    from phigen.compilation import Compilation
    from phigen.scheme.program import Program
    from phigen.spec.model import Run, Spec

QUATERNION = ("w", "x", "y", "z")
POSITION = ("x", "y", "z")


@dataclass(frozen=True)
class Variable:
    """Quantity of the solver that ``modelDescription.xml`` offers to the simulator.

    ``number`` identifies the variable (the value reference of FMI). ``start`` is its initial value, or None if the
    solver computes it. ``whole`` marks integers, and ``positive`` marks variables with lower bound 0.
    """

    name: str
    causality: str  # independent, input, output or parameter
    variability: str  # continuous, tunable or fixed
    start: float | None = None
    description: str = ""
    unit: str = ""
    positive: bool = False
    whole: bool = False
    number: int = 0

    @property
    def initial(self) -> str:
        """The attribute ``initial`` of the variable in FMI: "exact", "calculated", or "" if FMI allows no attribute for
        its causality.
        """
        if self.causality in ("independent", "input"):
            return ""
        return "calculated" if self.start is None else "exact"


def first_run(spec: Spec) -> Run:
    """Return the first run of the spec whose step is positive.

    The FMU has the initial state, the parameters and the step of this run. Raises `SpecError` for lattices, and for a
    spec in which no run has a positive step.
    """
    if spec.lattice:
        hint = "make the FMU of an ordinary spec, which phigen show --expand SIZES prints for a small lattice"
        raise SpecError(
            [spec.diagnostic(("lattice",), f"{spec.name} is a lattice, for which there are no FMUs yet", hint)]
        )
    if not spec.runs:
        message = f"an FMU of {spec.name} needs initial values and a step, and the spec has no runs"
        raise SpecError([spec.diagnostic(("name",), message, "runs: {NAME: {initial: …, step: …, steps: …}}")])
    for run in spec.runs.values():
        if run.step > 0:
            return run
    name, run = next(iter(spec.runs.items()))
    message = f"an FMU of {spec.name} needs a run that goes forward in time, and the step of {name} is {run.step}"
    hint = "add a run with a positive step; an FMU goes forward in time only"
    raise SpecError([spec.diagnostic(("runs", name, "step"), message, hint)])


def variables_of(compilation: Compilation) -> tuple[Variable, ...]:
    """Return all variables in the order of their numbers 0, 1, …; variables of one kind, such as parameters, are
    adjacent."""
    all_variables = chain.from_iterable(_kinds(compilation).values())
    return tuple(replace(variable, number=k) for k, variable in enumerate(all_variables))


def first_numbers(compilation: Compilation) -> dict[str, int]:
    """Return a dict with the number of the first variable of each kind, such as "STATE".

    A kind without variables has the number at which the next kind begins. The entry ``END`` is the last number plus 1.
    """
    numbers, number = {}, 0
    for kind, variables_of_kind in _kinds(compilation).items():
        numbers[kind] = number
        number += len(variables_of_kind)
    return numbers | {"END": number}


def _kinds(compilation: Compilation) -> dict[str, list[Variable]]:
    """Return the variables by kind, such as "STATE". The order of the result determines the numbers of the
    variables.
    """
    spec, program = compilation.spec, compilation.program
    run = first_run(spec)
    return {
        "TIME": [_time(spec)],
        "STATE": list(_states(spec, run)),
        "PARAMETER": list(_parameters(spec, run)),
        "STEP": [_step(program, run)],
        "SEED": list(_seed(program, run)),
        "ATTITUDE": list(_attitude(program)),
        "POSITION": list(_position(program)),
        "ENERGY": [Variable("system.hamiltonian", "output", "continuous", description="the Hamiltonian")],
        "CASIMIR": list(_casimirs(program)),
        "OBSERVABLE": [
            Variable(f"observables.{x}", "output", "continuous", description="observable") for x in program.observed
        ],
    }


def _time(spec: Spec) -> Variable:
    names = {*spec.coordinates, *(p.name for p in spec.parameters)}
    return Variable("system.time" if "time" in names else "time", "independent", "continuous", description="the time")


def _states(spec: Spec, run: Run) -> Iterator[Variable]:
    for name, value in zip(spec.coordinates, run.initial, strict=True):
        yield Variable(name, "output", "continuous", float(value), "coordinate")


def _parameters(spec: Spec, run: Run) -> Iterator[Variable]:
    values = spec.parameters_of(run)
    for p in spec.parameters:
        causality, variability = ("input", "continuous") if p.name in spec.inputs else ("parameter", "tunable")
        yield Variable(p.name, causality, variability, values[p.name], p.description, p.unit, bool(p.bound))


def _step(program: Program, run: Run) -> Variable:
    variable = "tau" if program.monitor else "time"
    size = f"size of a whole step in {variable}; communication steps may have any size"
    size = f"size of a whole step in {variable}; communication steps must be multiples of it" if program.noise else size
    return Variable("solver.step", "parameter", "fixed", float(run.step), size, positive=True)


def _seed(program: Program, run: Run) -> Iterator[Variable]:
    if program.noise:
        seed = "seed of the random numbers"
        yield Variable("solver.seed", "parameter", "fixed", run.seed, seed, whole=True)


def _attitude(program: Program) -> Iterator[Variable]:
    """Yield the variables for the entries of the attitude. The initial attitude is the identity."""
    if not program.attitude:
        return
    rows = program.attitude.group.rows
    names = [f"[{i + 1},{j + 1}]" for i in range(rows) for j in range(rows)] or [f".{name}" for name in QUATERNION]
    description = "of the attitude matrix" if rows else "of the quaternion that rotates body into space coordinates"
    for k, name in enumerate(names):
        is_one = k % (rows + 1) == 0 if rows else k == 0
        yield Variable(f"attitude{name}", "output", "continuous", float(is_one), f"entry {description}")


def _position(program: Program) -> Iterator[Variable]:
    """Yield the variables for the position of the body in space, if the solver computes it. The initial
    position is 0.
    """
    if program.attitude and program.attitude.group.translation:
        for name in POSITION:
            yield Variable(f"position.{name}", "output", "continuous", 0.0, "position of the body in space")


def _casimirs(program: Program) -> Iterator[Variable]:
    for name in program.casimirs:
        constancy = "" if name in program.pushed else ", constant along trajectories"
        yield Variable(f"casimirs.{name}", "output", "continuous", description=f"Casimir{constancy}")
