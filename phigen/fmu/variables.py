"""The variables of an FMU, which the importing simulator reads and sets by their numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
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
    """A variable of ``modelDescription.xml``.

    ``number`` is its value reference, the same in FMI 2.0 and 3.0. ``start`` is its initial value, None if the solver
    computes it. ``whole`` is true for an integer, ``positive`` for a lower bound of 0.
    """

    name: str
    causality: str  # independent, input, output, parameter
    variability: str  # continuous, tunable, fixed
    start: float | None = None
    description: str = ""
    unit: str = ""
    positive: bool = False
    whole: bool = False
    number: int = 0

    @property
    def initial(self) -> str:
        """Return the attribute ``initial``, exact or calculated; empty for causalities that may not have it."""
        if self.causality in ("independent", "input"):
            return ""
        return "calculated" if self.start is None else "exact"


def first_run(spec: Spec) -> Run:
    """Return the run that supplies the initial state, parameters and step of an FMU: the first of the spec.

    Raises `SpecError` for lattices, and for a spec without runs.
    """
    if spec.lattice:
        hint = "phigen show --expand SIZES prints a small lattice as an ordinary spec, of which there can be an FMU"
        raise SpecError(
            [spec.diagnostic(("lattice",), f"an FMU of {spec.name}: not for lattices in this version", hint)]
        )
    if not spec.runs:
        message = f"an FMU of {spec.name} needs initial values and a step, and the spec has no runs"
        raise SpecError([spec.diagnostic(("name",), message, "runs: {NAME: {initial: …, step: …, steps: …}}")])
    return next(iter(spec.runs.values()))


def variables_of(compilation: Compilation) -> tuple[Variable, ...]:
    """Return all variables in the order of their numbers, as in `first_numbers`."""
    spec, program = compilation.spec, compilation.program
    run = first_run(spec)
    listed = [_time(spec), *_states(spec, run), *_parameters(spec, run), *_solver(program, run)]
    listed += [*_attitude(program), *_results(program)]
    return tuple(replace(variable, number=k) for k, variable in enumerate(listed))


def first_numbers(compilation: Compilation) -> dict[str, int]:
    """Return the number of the first variable of each kind. An absent kind has the number of the kind after it."""
    program = compilation.program
    attitude, element = _sizes_of_attitude(program)
    counts = {
        "TIME": 1,
        "STATE": program.dimension,
        "PARAMETER": len(program.parameters),
        "STEP": 1,
        "SEED": int(program.noise is not None),
        "ATTITUDE": attitude,
        "POSITION": element - attitude,
        "ENERGY": 1,
        "CASIMIR": len(program.casimirs),
        "OBSERVABLE": len(program.observed),
    }
    numbers, number = {}, 0
    for kind, count in counts.items():
        numbers[kind] = number
        number += count
    return numbers | {"END": number}


def _sizes_of_attitude(program: Program) -> tuple[int, int]:
    """Return the number of entries of the attitude, and of attitude and position together; 0 and 0 without attitude."""
    if not program.attitude:
        return 0, 0
    size = math.prod(program.attitude.shape)
    return size, size + 3 * bool(program.attitude.group.translation)


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


def _solver(program: Program, run: Run) -> Iterator[Variable]:
    variable = "tau" if program.monitor else "time"
    size = f"size of a whole step in {variable}; communication steps may have any size"
    size = f"size of a whole step in {variable}; communication steps must be multiples of it" if program.noise else size
    yield Variable("solver.step", "parameter", "fixed", float(run.step), size, positive=True)
    if program.noise:
        seed = "seed of the random numbers"
        yield Variable("solver.seed", "parameter", "fixed", run.seed, seed, whole=True)


def _attitude(program: Program) -> Iterator[Variable]:
    """Yield the entries of the attitude, which starts as the identity, and of the position, which starts at 0."""
    if not program.attitude:
        return
    rows = program.attitude.group.rows
    names = [f"[{i + 1},{j + 1}]" for i in range(rows) for j in range(rows)] or [f".{name}" for name in QUATERNION]
    shown = "of the attitude matrix" if rows else "of the quaternion that rotates body into space coordinates"
    for k, name in enumerate(names):
        one = k % (rows + 1) == 0 if rows else k == 0
        yield Variable(f"attitude{name}", "output", "continuous", float(one), f"entry {shown}")
    if program.attitude.group.translation:
        for name in POSITION:
            yield Variable(f"position.{name}", "output", "continuous", 0.0, "position of the body in space")


def _results(program: Program) -> Iterator[Variable]:
    yield Variable("system.hamiltonian", "output", "continuous", description="the Hamiltonian")
    for name in program.casimirs:
        constancy = "" if name in program.pushed else ", constant along trajectories"
        yield Variable(f"casimirs.{name}", "output", "continuous", description=f"Casimir{constancy}")
    for name in program.observed:
        yield Variable(f"observables.{name}", "output", "continuous", description="observable")
