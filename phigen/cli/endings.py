"""Ends of runs, and the states that are stored: the interpretation of steps, until, stop, every and stride."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import click

from phigen.cli.console import Console
from phigen.cli.experiment import Experiment
from phigen.runtime.ending import End, after_steps, at_time, where_zero
from phigen.runtime.interface import BackendError
from phigen.runtime.lattice import LatticeSolver
from phigen.runtime.solver import Solver

#: Largest number of requested times.
_MOST_TIMES = 10_000_000

#: An experiment of an ordinary system or a lattice, and its solver.
E = TypeVar("E", bound=Experiment)
AnySolver = Solver | LatticeSolver


def ended(experiment: E, solver: AnySolver, console: Console) -> E:
    """Return the experiment with its end, if that is at a time or at a zero of ``stop``."""
    run, h = experiment.run, experiment.h
    end: End | None = None
    if run.until is not None:
        span = float(run.until) - experiment.begin
        if span * h <= 0:
            message = f"the end, {float(run.until)!r}, is never reached from {experiment.begin!r} by steps of {h!r}"
            raise click.UsageError(f"{message}; --until T sets another end")
        end = at_time(experiment.begun(solver), h, span)
    if run.stop is not None:
        end = _stopped(experiment, solver, console, end) or end
    if end is None:
        return experiment
    stride = max(1, min(run.stride, end.steps))
    return replace(experiment, run=replace(run, steps=end.steps, stride=stride), end=end)


def _stopped(experiment: Experiment, solver: AnySolver, console: Console, end: End | None) -> End | None:
    """Return the zero of ``stop``, if it is before the end."""
    run, names, h = experiment.run, solver.interface, experiment.h
    assert run.stop is not None
    g = experiment.function(run.stop, solver)
    max_steps = end.steps + 1 if end else run.steps
    zero = where_zero(experiment.begun(solver), h, max_steps, g, experiment.begin, timed=bool(names.time))
    if zero is None:
        console.note("stop: is not met")
        return None
    if end is None or zero.steps < end.steps:
        return zero
    try:
        last = _count(experiment, solver, end)
    except BackendError:  # the final part of a step, which the run would make without a stop, fails
        return zero
    return zero if _count(experiment, solver, zero) < last else None


def _count(experiment: Experiment, solver: AnySolver, end: End) -> float:
    """Count the steps up to an end, including the fraction of the last. Raises `BackendError`."""
    if not end.part:
        return float(end.steps)
    session = experiment.begun(solver)
    session.advance(experiment.h, end.steps)
    return end.finish(session)[1]


def length(experiment: Experiment, solver: AnySolver) -> float:
    """Length of a run up to its end, in the variable of equal steps, τ or t. Raises `StepError`."""
    if experiment.end is None:
        return abs(experiment.h) * experiment.run.steps
    try:
        return abs(experiment.h) * _count(experiment, solver, experiment.end)
    except BackendError as error:
        raise solver.failure(error, experiment.h, None, experiment.parameters) from error


def timed(experiment: E, solver: AnySolver, every: float | None = None, at: str | None = None) -> E:
    """Return the experiment with the times of stored states: equal distances, or a list, up to the end."""
    if every is None and at is None and experiment.run.every is not None:
        every = float(experiment.run.every)
    time_list = _parse_times(at) if at is not None else [float(t) for t in experiment.run.at] if every is None else []
    if every is None and not time_list:
        return experiment
    if experiment.end is None and solver.interface.monitored:  # the session itself measures the time of its steps
        end_time = after_steps(experiment.begun(solver), experiment.h, experiment.run.steps)
        experiment = replace(experiment, end=end_time)
    times = (
        _regular(experiment, solver, every)
        if every is not None
        else _times_in_run(experiment, solver, time_list, at is not None)
    )
    return replace(experiment, times=tuple(times))


def _times_in_run(experiment: Experiment, solver: AnySolver, times: list[float], asked: bool) -> list[float]:
    """Return the listed times in order, without the start and times beyond a stop.

    Times ``asked`` for on the command line must be before the end; those of the spec are dropped if the run ends
    earlier.
    """
    begin, end, sign = experiment.begin, experiment.until, math.copysign(1.0, experiment.h)
    too_late = [t for t in times if (t - end) * sign > 1e-9 * abs(end - begin)]
    stopped = experiment.end is not None and experiment.end.stopped
    too_early = [t for t in times if (t - begin) * sign < 0]
    outside_times = too_early + ([] if stopped else too_late)
    if outside_times and asked:
        raise click.BadParameter(f"{outside_times[0]!r} is not between {begin!r} and {end!r}", param_hint="--at")
    times = sorted({*times} - {begin, *too_early, *too_late}, reverse=sign < 0)
    _expect_whole(experiment, solver, times, "--at")
    return times


def _regular(experiment: Experiment, solver: AnySolver, every: float) -> list[float]:
    """Return times with equal distances, counted from the start."""
    begin, end, sign = experiment.begin, experiment.until, math.copysign(1.0, experiment.h)
    if not every > 0 or not math.isfinite(every):
        raise click.BadParameter("the time between states must be positive", param_hint="--every")
    count = abs(end - experiment.t0) / every * (1 + 1e-12)
    if count > _MOST_TIMES:
        raise click.UsageError(f"--every {every!r} would store {count:.3g} states, the limit is {_MOST_TIMES:.3g}")
    times = [experiment.t0 + sign * every * k for k in range(1, int(count) + 1)]
    _expect_whole(experiment, solver, times, "--every")
    return [t for t in times if (t - begin) * sign > 0]


def _expect_whole(experiment: Experiment, solver: AnySolver, times: Sequence[float], option: str) -> None:
    """Check that all times are ends of steps: the path of the noise is known only there."""
    for time in times if solver.interface.noise else ():
        steps = (time - experiment.begin) / experiment.h
        if abs(steps - round(steps)) > 1e-9 * max(1.0, abs(steps)):
            message = f"with noise, states are known only after whole steps of {abs(experiment.h)!r}; the time"
            raise click.BadParameter(f"{message} {time!r} is between two", param_hint=option)


def _parse_times(at: str) -> list[float]:
    text: Any = Path(at).read_text(encoding="utf-8") if Path(at).is_file() else at
    try:
        times = [float(word) for word in text.replace(",", " ").split()]
    except ValueError as error:
        raise click.BadParameter(f"expected times or a file of times: {error}", param_hint="--at") from None
    if not times or not all(map(math.isfinite, times)):
        raise click.BadParameter("expected at least one time, and finite numbers only", param_hint="--at")
    return times
