"""A run of a lattice, changed by options of the command line. It may continue another run."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from phigen.cli.experiment import Experiment
from phigen.reading import opened, opened_text
from phigen.runtime.arguments import Beginning
from phigen.runtime.interface import Draws, Floats, LatticeInterface
from phigen.runtime.lattice_course import ObservedCourse
from phigen.runtime.lattice_frames import state_columns
from phigen.runtime.lattice_rows import IntegrationPlan, Past, strided, timed, timed_in_tau
from phigen.runtime.lattice_series import key_of

if TYPE_CHECKING:
    from phigen.lattice.states import Start
    from phigen.runtime.crossings import Function
    from phigen.runtime.lattice import LatticeSolver
    from phigen.spec.model import Run
    from phigen.symbolic.expression import Expression

#: Errors of reading that show that a file does not contain a run.
_UNREADABLE = (OSError, ValueError, KeyError, EOFError, IndexError, zipfile.BadZipFile)


@dataclass(frozen=True)
class LatticeExperiment(Experiment):
    """Run of a lattice, changed by options of the command line.

    ``start`` has the initial state and the parameters. ``past`` has the rows of a finished run that this run continues
    (`phigen.runtime.lattice_rows.Past`). ``origin`` is a text that says from which run an output file comes.
    """

    start: Start | None = None
    origin: str = ""

    @property
    def begin(self) -> float:
        """The time at which the steps start: the start of the run, or the end of the finished run ``past``."""
        return float(self.past.t[-1]) if self.past else self.t0

    def beginning(self, solver: LatticeSolver) -> Beginning:
        """Return the initial state, step size, parameters, time and random numbers of the steps.

        If the run has a monitor and continues a finished run, the result also has the energy level e = −H at the start
        of the finished run.
        """
        assert self.start is not None
        state = solver.state(self.start.state if self.past is None else self.past.last, "x0")
        values = solver.values(self.parameters, {}, state.shape[1:])
        draws = Draws(self.run.seed, step=self.made) if solver.interface.noise else Draws()
        level = None
        if self.past is not None and solver.interface.monitored:
            level = -solver.hamiltonian(self.start.state, parameters=values)
        return Beginning(state, self.h, values, self.begin if solver.interface.time else 0.0, draws, level=level)

    def begun(self, solver: LatticeSolver) -> ObservedCourse:
        """Return an integration before its first step. Raises `StepError`."""
        return ObservedCourse.begun(solver, self.beginning(solver))

    def function(self, expression: Expression, solver: LatticeSolver) -> Function:
        """Return an expression of the spec as a function of observables."""
        return solver.function(expression, self.parameters)

    def plan(self, solver: LatticeSolver) -> IntegrationPlan:
        """Return the plan of the integration: start, rows, and outputs."""
        beginning, run = self.beginning(solver), self.run
        if self.times is None:
            rows = strided(beginning.h, run.steps, run.stride, self.end)
        elif solver.interface.monitored:
            assert self.end is not None
            rows = timed_in_tau(self.spans, self.end)
        else:
            rows = timed(beginning.h, run.steps, self.spans, self.end)
        section, transforms = solver.section_of(run, beginning.values), solver.transforms_of(run)
        further: Any = {"section": section, "transforms": transforms, "past": self.past, "origin": self.origin}
        return IntegrationPlan(beginning, rows, self.begin, **further)


def started_from(run: Run, start: Start, source: Path, solver: LatticeSolver) -> tuple[Run, Start]:
    """Return the run and its start, changed so that the run starts at the last state in the file of another
    run.

    If H depends on the time, the run also starts at the time of that state. Raises `click.BadParameter` if the file
    does not contain a run of a lattice, or if its states have another shape.
    """
    try:
        state, t = _last_of(source, solver.interface, start.state.shape)
    except _UNREADABLE as error:
        kinds = ".csv of states" if source.suffix.lower() == ".csv" else ".npz of a run of a lattice"
        raise click.BadParameter(f"{source} is no {kinds}: {_reason(error)}", param_hint="--from") from None
    if state.shape != start.state.shape or not np.isfinite(state).all():
        message = f"{source} ends with a state of shape {state.shape}, the run has {start.state.shape}"
        complaint = message if state.shape != start.state.shape else f"the last state in {source} is not finite"
        raise click.BadParameter(complaint, param_hint="--from")
    return replace(run, start=Fraction(t)) if solver.interface.time else run, replace(start, state=state)


def _last_of(source: Path, interface: LatticeInterface, shape: tuple[int, ...]) -> tuple[Floats, float]:
    """Return the last state in the file of a run, and the time of this state."""
    if source.suffix.lower() == ".csv":
        table = _table(source, interface, shape)
        return table.last, float(table.t[-1])
    with opened(source) as file, np.load(file, allow_pickle=False) as archive:
        last = archive["last"] if "last" in archive else archive["x"][-1]
        return np.asarray(last, dtype=np.float64), float(archive["t"][-1])


def extended(experiment: LatticeExperiment, path: Path, solver: LatticeSolver) -> LatticeExperiment:
    """Return the experiment that continues a finished run, whose rows are in the file ``path``."""
    run, start = experiment.run, experiment.start
    assert start is not None
    if run.records_numbers and path.suffix.lower() == ".csv":
        message = f"{path} contains no state to continue from: `record` of the run {run.name} does not list `state`"
        raise click.UsageError(f"--extend: {message}; store the run in a .npz file, which contains the last state")
    try:
        earlier_run = _past_of(path, run, solver.interface, start.state.shape)
    except _UNREADABLE as error:
        message = f"{path} does not hold a run of {solver.interface.name}: {_reason(error)}"
        raise click.BadParameter(message, param_hint="--extend") from None
    if earlier_run.t[0] != experiment.t0 or not np.array_equal(earlier_run.first, start.state):
        complaint = f"its first row, at t = {float(earlier_run.t[0])!r}, is not the start of the run {run.name}"
        raise click.BadParameter(f"{path} is of another run: {complaint}", param_hint="--extend")
    steps = earlier_run.steps or round((float(earlier_run.t[-1]) - experiment.t0) / experiment.h)
    # With a monitor, steps are not equal in t, so the times do not determine the number of steps. A .npz file contains
    # this number. A .csv file does not, and ``earlier_run.steps`` is then 0.
    steps = earlier_run.steps if solver.interface.monitored else steps
    return replace(experiment, past=replace(earlier_run, steps=steps))


def _past_of(path: Path, run: Run, interface: LatticeInterface, shape: tuple[int, ...]) -> Past:
    """Return the rows of a finished run. Raises one of `_UNREADABLE` if the file is not that of a run."""
    if path.suffix.lower() == ".csv":
        return _table(path, interface, shape)
    numbers = run.record if run.records_numbers else ("energy", *interface.observables)
    with opened(path) as file, np.load(file, allow_pickle=False) as archive:
        t = _rows(archive["t"], "t")
        columns = {name: _rows(archive[key_of(name, interface)], name, len(t)) for name in numbers}
        steps = int(archive["steps"])
        if run.records_numbers:
            first, last = (np.asarray(archive[name], dtype=np.float64) for name in ("first", "last"))
            return _checked(Past(t, first, last, columns, steps), shape)
        x = np.asarray(archive["x"], dtype=np.float64)
        if x.shape != (len(t), *shape):
            raise ValueError(f"x has the shape {x.shape}, not {(len(t), *shape)}")
        return _checked(Past(t, x[0], x[-1], columns, steps, x), shape)


def _table(path: Path, interface: LatticeInterface, shape: tuple[int, ...]) -> Past:
    """Return the rows of a ``.csv`` file of states. The number of steps is 0, since the file does not contain it."""
    columns = state_columns(interface, shape[1:])
    expected = [name for column in columns for name in column.names]
    with opened_text(path) as file:
        header = file.readline().strip().split(",")
        if header != expected:
            strange = next(
                (f"but not the column {name}" for name in expected if name not in header), f"not {len(expected)}"
            )
            raise ValueError(f"it has {len(header)} columns, {strange}")
        rows = np.loadtxt(file, delimiter=",", ndmin=2)
    if not rows.size or rows.shape[1] != len(expected):
        raise ValueError("it has no rows")
    keys = {name: rows[:, expected.index(column.names[0])] for column in columns for name in [column.key]}
    numbers = {"energy": keys["energy"]} | {name: keys[f"observable_{name}"] for name in interface.observables}
    x = rows[:, 1 : 1 + int(np.prod(shape))].reshape(-1, *shape)
    return _checked(Past(rows[:, 0], x[0], x[-1], numbers, 0, x), shape)


def _rows(values: Any, name: str, count: int | None = None) -> Floats:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 1 or not len(array) or len(array) != (count or len(array)):
        raise ValueError(f"{name} has the shape {array.shape}")
    return array


def _checked(earlier_run: Past, shape: tuple[int, ...]) -> Past:
    """Return the finished run unchanged.

    Raises `ValueError` if its states have another shape, or if its last state is not finite.
    """
    if earlier_run.first.shape != shape or earlier_run.last.shape != shape:
        raise ValueError(f"its states have the shape {earlier_run.last.shape}, those of the run {shape}")
    if not (np.isfinite(earlier_run.last).all() and np.isfinite(earlier_run.t[-1])):
        raise ValueError("its last state is not finite")
    return earlier_run


def _reason(error: Exception) -> str:
    return f"it has no {error}" if isinstance(error, KeyError) else str(error)
