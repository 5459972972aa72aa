"""Runs that begin where others ended: their files, and the sessions that stand there."""

from __future__ import annotations

import math
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from phigen.cli.console import Console
from phigen.cli.experiment import Experiment
from phigen.runtime.ending import End, at_time, where_zero
from phigen.runtime.interface import BackendError, Draws, Floats, Interface
from phigen.runtime.session import Session
from phigen.runtime.solver import Solver
from phigen.runtime.tables import Column
from phigen.runtime.trajectory import element_columns, trajectory_columns
from phigen.study.sections import function_of

#: How many times may be asked for.
_MOST_TIMES = 10_000_000
#: Times apart by less of all that has passed are one.
_EQUAL = 1e-9


@dataclass(frozen=True)
class Past:
    """The rows of a finished run, as they are in its file, by the names of their columns."""

    columns: tuple[str, ...]
    rows: Floats

    @property
    def t(self) -> float:
        """The time where it ended."""
        return float(self.rows[-1, 0])

    def last(self, names: Sequence[str]) -> Floats:
        """Values of the last row; raises `KeyError` for a column that is not there."""
        places = {name: i for i, name in enumerate(self.columns)}
        return np.array([self.rows[-1, places[name]] for name in names])


def columns_of(names: Interface) -> list[Column]:
    """The columns of the rows of a run."""
    turned = element_columns(names.attitude, position=names.position)
    return trajectory_columns(names.coordinates, names.casimirs, turned, monitored=names.monitored)


def past_of(path: Path, names: Interface, option: str) -> Past:
    """What is in a file that a run has written."""
    try:
        past = _of_npz(path, names) if path.suffix.lower() == ".npz" else _of_csv(path)
        if len(past.rows):
            past.last([n for c in columns_of(names)[: 2 + names.monitored] for n in c.names])
            return past
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        why = f"it has no column {error}" if isinstance(error, KeyError) else str(error)
        raise click.BadParameter(f"{path} is no file of a run of {names.name}: {why}", param_hint=option) from None
    raise click.BadParameter(f"{path} has no rows", param_hint=option)


def _of_csv(path: Path) -> Past:
    with path.open(encoding="utf-8") as file:
        header = tuple(file.readline().strip().split(","))
        return Past(header, np.loadtxt(file, delimiter=",", ndmin=2))


def _of_npz(path: Path, names: Interface) -> Past:
    with np.load(path, allow_pickle=False) as stored:
        found = [(column, stored[column.key]) for column in columns_of(names) if column.key in stored]
    header = tuple(name for column, _ in found for name in column.names)
    return Past(header, np.column_stack([values for _, values in found]))


def started_from(experiment: Experiment, past: Past, solver: Solver) -> Experiment:
    """The experiment from the last state of another run, with its time where there is one, and its attitude."""
    names = solver.interface
    _, *columns = columns_of(names)
    state = next(past.last(column.names) for column in columns if column.key == "x")
    turned = [name for column in element_columns(names.attitude, position=names.position) for name in column.names]
    first = past.last(turned) if turned and set(turned) <= set(past.columns) else None
    run = replace(experiment.run, start=type(experiment.run.start)(past.t)) if names.time else experiment.run
    return replace(experiment, run=run, initial=tuple(state.tolist()), first=first)


def begun(solver: Solver, experiment: Experiment) -> Session:
    """A session where the steps of an experiment begin.

    One that goes on with a finished run holds the gauge of its start, or its e.
    """
    backend, past, names = solver.backend, experiment.past, solver.interface
    initial = np.array(experiment.initial)
    draws = Draws(experiment.run.seed, step=experiment.made if names.noise else 0)
    try:
        if past is None:
            return backend.start(initial, experiment.parameters, experiment.t0, experiment.first, draws)
        here = started_from(experiment, past, solver)
        session = backend.start(initial, experiment.parameters, past.t if names.time else 0.0, here.first, draws)
        if names.monitored:
            return session.placed(np.array(here.initial))
        session.place(np.array(here.initial))
        return session
    except BackendError as error:
        raise solver.failure(error, experiment.h, None, experiment.parameters) from error


def extended(experiment: Experiment, path: Path, solver: Solver) -> Experiment:
    """The experiment after the rows of a finished run of it."""
    names = solver.interface
    past = past_of(path, names, "--extend")
    wanted = [name for column in columns_of(names) for name in column.names]
    state = names.dimension + 1 + names.monitored
    begin = past.rows[0, :state].tolist()
    if list(past.columns) != wanted or begin != [experiment.t0, *[0.0] * names.monitored, *experiment.initial]:
        message = f"{path} is of another run: its first row is {', '.join(map(repr, begin))}"
        raise click.BadParameter(message, param_hint="--extend")
    found = replace(experiment, past=past)
    missed = past.t - found.t0 - found.made * found.h
    if found.run.members > 1 and abs(missed) > _EQUAL * found.made * abs(found.h):
        message = f"{path} ends with a part of a step, at t = {past.t!r}, which the means of members are not told of"
        raise click.BadParameter(f"{message}: make the run anew, to its new end", param_hint="--extend")
    return found


def ended(experiment: Experiment, solver: Solver, console: Console) -> Experiment:
    """The experiment with its end, where that is at a time, or where ``stop`` passes through zero."""
    run, h = experiment.run, experiment.h
    end: End | None = None
    if run.until is not None:
        span = float(run.until) - experiment.begin
        if span * h <= 0:
            message = f"{float(run.until)!r} is never reached from {experiment.begin!r}"
            raise click.BadParameter(message, param_hint="--until")
        end = at_time(begun(solver, experiment), h, span)
    if run.stop is not None:
        end = _stopped(experiment, solver, console, end) or end
    if end is None:
        return experiment
    stride = max(1, min(run.stride, end.steps))
    return replace(experiment, run=replace(run, steps=end.steps, stride=stride), end=end)


def _stopped(experiment: Experiment, solver: Solver, console: Console, end: End | None) -> End | None:
    """Where ``stop`` is met, if that is before the end."""
    run, names, h = experiment.run, solver.interface, experiment.h
    assert run.stop is not None
    g = function_of(run.stop, names.coordinates, experiment.parameters, names.time)
    most = end.steps + 1 if end else run.steps
    found = where_zero(begun(solver, experiment), h, most, g, experiment.begin, timed=bool(names.time))
    if found is None:
        console.note("stop: is not met")
        return None
    if end is None or found.steps < end.steps:
        return found
    start = begun(solver, experiment)
    start.advance(h, end.steps)
    return found if found.finish(start)[1] < end.finish(start)[1] else None


def timed(experiment: Experiment, solver: Solver, every: float | None, at: str | None) -> Experiment:
    """The experiment with the times of the states that are stored: every so often, or those listed, up to the end."""
    run, begin, sign = experiment.run, experiment.begin, math.copysign(1.0, experiment.h)
    if every is None and at is None:
        every = float(run.every) if run.every is not None else None
    if every is None and at is None:
        return experiment
    if experiment.end is None and solver.interface.monitored:
        raise click.UsageError("steps are equal in τ here: say where the run ends in time, by --until or until:")
    end = experiment.until
    if at is not None:
        times = _listed(at)
        beyond = [t for t in times if (t - end) * sign > 1e-9 * abs(end - begin)]
        stopped = experiment.end is not None and experiment.end.stopped
        outside = [t for t in times if (t - begin) * sign < 0] + ([] if stopped else beyond)
        if outside:
            raise click.BadParameter(f"{outside[0]!r} is not between {begin!r} and {end!r}", param_hint="--at")
        times = sorted({*times} - {begin, *beyond}, reverse=sign < 0)
        _expect_whole(experiment, solver, times, "--at")
        return replace(experiment, times=tuple(times))
    assert every is not None
    if not every > 0 or not math.isfinite(every):
        raise click.BadParameter("the time between states must be positive", param_hint="--every")
    count = abs(end - experiment.t0) / every * (1 + 1e-12)
    if count > _MOST_TIMES:
        raise click.BadParameter(f"that would be {count:.3g} states", param_hint="--every")
    times = [experiment.t0 + sign * every * k for k in range(1, int(count) + 1)]
    _expect_whole(experiment, solver, times, "--every")
    return replace(experiment, times=tuple(t for t in times if (t - begin) * sign > 0))


def _expect_whole(experiment: Experiment, solver: Solver, times: Sequence[float], option: str) -> None:
    """That a path of the noise is known at these times: at the ends of its steps, and nowhere between."""
    for time in times if solver.interface.noise else ():
        steps = (time - experiment.begin) / experiment.h
        if abs(steps - round(steps)) > 1e-9 * max(1.0, abs(steps)):
            message = f"with noise states are known after whole steps of {abs(experiment.h)!r}, and {time!r} is not"
            raise click.BadParameter(f"{message} at the end of one", param_hint=option)


def _listed(at: str) -> list[float]:
    text: Any = Path(at).read_text(encoding="utf-8") if Path(at).is_file() else at
    try:
        times = [float(word) for word in text.replace(",", " ").split()]
    except ValueError as error:
        raise click.BadParameter(f"times are numbers, or a file of them: {error}", param_hint="--at") from None
    if not times or not all(map(math.isfinite, times)):
        raise click.BadParameter("times are finite numbers, at least one", param_hint="--at")
    return times
