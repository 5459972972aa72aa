"""The initial value problem on which the search for settings measures methods, and the methods that solve it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from phigen.api import chosen_target, solver_of
from phigen.compilation import Compilation
from phigen.errors import PhigenError
from phigen.geometry.conservation import Unit, units
from phigen.geometry.system import System
from phigen.runtime.backend import Backend
from phigen.runtime.interface import BackendError, row_steps
from phigen.runtime.session import rows_along
from phigen.study import measures, race
from phigen.study.methods import Method as Step
from phigen.symbolic.arrays import Floats, evaluate
from phigen.tuning.settings import Setting, charts

#: Largest number of states at which the energy of one run is evaluated.
ROWS = 8_000
#: Relative change of the energy by the rounding error of one step, in double and in single precision. After n steps the
#: change is about √n times larger, as in a random walk.
ROUNDING, SINGLE_ROUNDING = 1.1e-16, 6e-8


@dataclass(frozen=True)
class Problem(ABC):
    """A tuning problem: initial state, parameters, step and duration of the run on which methods are measured.

    The search begins with steps of size ``step``. ``horizon`` is the duration of the run. Steps and times are positive
    here; ``direction`` is −1 for a run backwards in time. ``sizes`` are the sizes of a lattice, () for other systems.
    ``clock`` is the variable of all times: τ if the spec has a monitor, else t. All methods make steps of equal size in
    this variable. ``rounding`` is the relative rounding error of one step of phigen's solvers.
    """

    start: Floats
    parameters: Mapping[str, Any]
    step: float
    horizon: float
    direction: float = 1.0
    sizes: tuple[int, ...] = ()
    clock: str = "t"
    rounding: float = ROUNDING

    @property
    @abstractmethod
    def name(self) -> str:
        """Name of the system."""

    @property
    @abstractmethod
    def unit(self) -> Unit:
        """Unit in which energy errors are measured."""

    @property
    def most_rows(self) -> int:
        """Largest number of states at which the energy of one run is evaluated."""
        return ROWS

    @property
    @abstractmethod
    def evens_out(self) -> bool:
        """Whether monitors may be tried. They even out the speed of the motion."""

    def method(self, solver: Backend) -> Candidate:
        """Return an object that makes runs with ``solver``, from the initial state of this problem."""
        return Candidate(solver, self)

    @abstractmethod
    def guesses(self, current: Setting) -> list[Setting]:
        """Return the settings that the search measures first; ``current`` is the setting of the spec."""

    @abstractmethod
    def classical(self, compilation: Compilation, names: Sequence[str], state: Floats) -> race.Race:
        """Return the classical methods ``names``. Their runs start from the content of the array ``state``."""

    @abstractmethod
    def energies(self, states: Floats) -> Floats:
        """Return the energies H (rows,) of states (rows, DIM)."""

    def casimir_error(self, states: Floats) -> float | None:
        """Return the largest error of a Casimir along a run with states (rows, DIM); None if it is not measured."""
        return None

    def defect(self, step: Step, states: Floats, h: float) -> float | None:
        """Return the largest Poisson defect of steps of size h from states (rows, DIM); None if it is not measured."""
        return None


@dataclass(frozen=True)
class SystemProblem(Problem):
    """Tuning problem of a ``system`` without lattice."""

    system: System = field(kw_only=True)

    @property
    def name(self) -> str:
        """Name of the system."""
        return self.system.name

    @property
    def unit(self) -> Unit:
        """Unit in which energy errors are measured."""
        (unit,) = units([self.system.hamiltonian], self.system.coordinates, self.parameters, self.start)
        return unit

    @property
    def evens_out(self) -> bool:
        """Whether monitors may be tried: not for systems with forces, noise, or an H that depends on the time."""
        return not self.system.driven

    def guesses(self, current: Setting) -> list[Setting]:
        """Return the settings to measure first: splittings, Gauss methods, and each bi-realisation that might apply."""
        return charts(self.system, current)

    def classical(self, compilation: Compilation, names: Sequence[str], state: Floats) -> race.Race:
        """Return the classical methods ``names``, in C if there is a compiler, else in Python.

        The methods start from the content of the array ``state``, which may change between runs.
        """
        target = chosen_target("auto")
        if target == "c":
            return race.compiled(compilation, names, state, self.parameters)
        return race.interpreted(solver_of(compilation, target), names, state, self.parameters)

    def energies(self, states: Floats) -> Floats:
        """Return the energies H (rows,) of states (rows, DIM)."""
        values = {**self.parameters, **{c: states[:, i] for i, c in enumerate(self.system.coordinates)}}
        (energies,) = evaluate([self.system.hamiltonian], values)
        return np.broadcast_to(energies, (len(states),))

    def casimir_error(self, states: Floats) -> float | None:
        """Return the largest error of a Casimir along a run with states (rows, DIM); None if there are no Casimirs.

        The error is relative to the initial value or, if the terms of this value nearly cancel, to the terms.
        """
        system, casimirs = self.system, self.system.casimirs
        if not casimirs:
            return None
        columns: Mapping[str, object] = {c: states[:, i] for i, c in enumerate(system.coordinates)}
        values = evaluate([*casimirs.values()], {**self.parameters, **columns})
        sizes = units(casimirs.values(), system.coordinates, self.parameters, self.start)
        errors = [
            np.max(u.errors(np.broadcast_to(v, len(states)), float(np.ravel(v)[0])))
            for u, v in zip(sizes, values, strict=True)
        ]
        return float(max(errors))

    def defect(self, step: Step, states: Floats, h: float) -> float | None:
        """Return the largest Poisson defect of steps of size h from states (rows, DIM); None if a step fails."""
        signed = self.direction * h
        try:
            return max(measures.poisson_defect(self.system, self.parameters, step, x, signed) for x in states)
        except PhigenError:
            return None


def rounding_of(compilation: Compilation) -> float:
    """Return the relative rounding error of one step in the number type of the measured solvers. Solvers in NumPy
    always have double precision.
    """
    return SINGLE_ROUNDING if compilation.program.single and chosen_target("auto") == "c" else ROUNDING


class CompiledMethod(Protocol):
    """A method that makes runs from the initial state of a problem, usually in compiled code."""

    @property
    def rounding(self) -> float:
        """The relative rounding error of one step."""
        ...

    def rows(self, h: float, steps: int, stride: int) -> Floats | None:
        """Return the states (rows, DIM) after 0, stride, 2·stride, … steps and after all steps; None if a step
        fails."""
        ...

    def walk(self, h: float) -> Callable[[int], object]:
        """Return a function for timing, with a number of steps as argument. The function makes this number of further
        steps of size ``h``.

        The first call starts from the initial state.
        """
        ...


@dataclass(frozen=True)
class Candidate:
    """A phigen solver as a method for the search. Its runs start from the initial state of ``problem``."""

    solver: Backend
    problem: Problem

    @property
    def rounding(self) -> float:
        """The relative rounding error of one step, in the number type of the solver."""
        return self.problem.rounding

    def rows(self, h: float, steps: int, stride: int) -> Floats | None:
        problem = self.problem
        try:
            session = self.solver.start(problem.start, problem.parameters)
            rows = rows_along(session, problem.direction * h, steps, stride, None)
        except BackendError:
            return None
        return rows if np.isfinite(rows).all() else None

    def reach(self, h: float, steps: int) -> tuple[float, str]:
        """Make a run of ``steps`` steps; return the time that it reached, and the status of the step that failed.

        The status is ``OK`` if no step failed.
        """
        try:
            session = self.solver.start(self.problem.start, self.problem.parameters)
            session.advance(self.problem.direction * h, steps)
        except BackendError as error:
            return error.step * h, error.status
        return steps * h, "OK"

    def walk(self, h: float) -> Callable[[int], object]:
        session = self.solver.start(self.problem.start, self.problem.parameters)
        return lambda steps: session.advance(self.problem.direction * h, steps)


@dataclass(frozen=True)
class Classical:
    """A classical method; ``runner`` makes its runs from the content of the array ``state``."""

    runner: race.Runner
    state: Floats
    problem: Problem

    @property
    def rounding(self) -> float:
        """The relative rounding error of one step. Classical methods have double precision."""
        return ROUNDING

    def rows(self, h: float, steps: int, stride: int) -> Floats | None:
        marks = row_steps(steps, stride)
        states = np.empty((len(marks), len(self.state)))
        states[0] = self.problem.start
        for row in range(1, len(marks)):
            self.state[:] = states[row - 1]
            state = self.runner(self.problem.direction * h, int(marks[row] - marks[row - 1]), 1)
            if state is None:
                return None
            states[row] = state
        return states

    def walk(self, h: float) -> Callable[[int], object]:
        # A step takes the same time at all states, so each call may start from the initial state of the problem.
        self.state[:] = self.problem.start
        return lambda steps: self.runner(self.problem.direction * h, steps, 1)


def steps_in(span: float, h: float) -> int:
    """Return the number of steps of about the size ``h`` for a span of time, at least 1."""
    return max(1, round(span / h))
