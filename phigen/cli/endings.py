"""The end of a run, and the times of its stored states, from keys of the run or options of the command."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import click

from phigen.cli.console import Console
from phigen.cli.experiment import Experiment
from phigen.runtime.ending import End, after_steps, at_time, where_zero
from phigen.runtime.interface import BackendError
from phigen.runtime.lattice import LatticeSolver
from phigen.runtime.solver import Solver

#: Largest number of states that ``--every`` may store: the list of 10⁷ times alone takes 0.3 GB.
_MOST_TIMES = 10_000_000

#: The class of an experiment: `Experiment`, or the class for lattices, which is derived from `Experiment`.
E = TypeVar("E", bound=Experiment)
AnySolver = Solver | LatticeSolver


def ended(experiment: E, solver: AnySolver, console: Console) -> E:
    """Return the experiment with its end, if the run has the key ``until`` or ``stop``.

    ``until`` is a time. ``stop`` is an expression, and the run ends at the first zero of this expression. The field
    ``end`` and the number of steps are set. Without these keys, the experiment is returned unchanged.
    """
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
    """Return the end of the run at the first zero of ``stop``; None if the run ends before the first zero."""
    run, names, h = experiment.run, solver.interface, experiment.h
    assert run.stop is not None
    g = experiment.function(run.stop, solver)
    max_steps = end.steps + 1 if end else run.steps
    zero = where_zero(experiment.begun(solver), h, max_steps, g, experiment.begin, timed=bool(names.time))
    if zero is None:
        console.note("the expression under stop: has no zero during the run")
        return None
    if end is None or zero.steps < end.steps:
        return zero
    try:
        last = _count(experiment, solver, end)
    except BackendError:  # the partial step up to ``until`` fails, but ``stop`` ends the run before this step
        return zero
    return zero if _count(experiment, solver, zero) < last else None


def _count(experiment: Experiment, solver: AnySolver, end: End) -> float:
    """Return the number of steps up to an end; a shorter last step counts as a fraction. Raises `BackendError`."""
    if not end.part:
        return float(end.steps)
    session = experiment.begun(solver)
    session.advance(experiment.h, end.steps)
    return end.finish(session)[1]


def length(experiment: Experiment, solver: AnySolver) -> float:
    """Return the length of a run up to its end, in the time t or, with a monitor, in the rescaled time τ.

    Raises `StepError`.
    """
    if experiment.end is None:
        return abs(experiment.h) * experiment.run.steps
    try:
        return abs(experiment.h) * _count(experiment, solver, experiment.end)
    except BackendError as error:
        raise solver.failure(error, experiment.h, None, experiment.parameters) from error


def timed(experiment: E, solver: AnySolver, every: float | None = None, at: Sequence[str] = ()) -> E:
    """Return the experiment with the times at which states are stored.

    ``every`` is the distance between the times. Alternatively, ``at`` lists the times: each entry is a text with times,
    or the path of a file with times. Without ``every`` and ``at``, the keys of the run apply.
    """
    if every is None and not at and experiment.run.every is not None:
        every = float(experiment.run.every)
    time_list = _parse_times(at) if at else [float(t) for t in experiment.run.at] if every is None else []
    if every is None and not time_list:
        return experiment
    # With a monitor, steps are not equal in t, so the steps must be made before the time of the end is known.
    if experiment.end is None and solver.interface.monitored:
        end_time = after_steps(experiment.begun(solver), experiment.h, experiment.run.steps)
        experiment = replace(experiment, end=end_time)
    times = (
        _regular(experiment, solver, every)
        if every is not None
        else _times_in_run(experiment, solver, time_list, bool(at))
    )
    return replace(experiment, times=tuple(times))


def _times_in_run(experiment: Experiment, solver: AnySolver, times: list[float], asked: bool) -> list[float]:
    """Return the listed times in order, without the start and without times outside the run.

    If the times come from the command line (``asked``), times outside the run raise `click.BadParameter`. But if
    ``stop`` has ended the run early, times after the end of the run are left out without an error.
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
    """Return times at equal distances, counted from the start of the run.

    If the run continues a finished one, the times of the finished run are left out.
    """
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
    """Raise `click.BadParameter` if the system has noise and a time lies inside a step.

    With noise, states are known only after whole steps.
    """
    for time in times if solver.interface.noise else ():
        steps = (time - experiment.begin) / experiment.h
        if abs(steps - round(steps)) > 1e-9 * max(1.0, abs(steps)):
            message = f"the time {time!r} is inside a step; with noise, states are known only after whole steps of"
            raise click.BadParameter(f"{message} {abs(experiment.h)!r}", param_hint=option)


def _parse_times(at: Sequence[str]) -> list[float]:
    texts = [Path(text).read_text(encoding="utf-8") if Path(text).is_file() else text for text in at]
    try:
        times = [float(word) for text in texts for word in text.replace(",", " ").split()]
    except ValueError as error:
        raise click.BadParameter(f"expected times or a file of times: {error}", param_hint="--at") from None
    if not times or not all(map(math.isfinite, times)):
        raise click.BadParameter("expected at least one time, and finite numbers only", param_hint="--at")
    return times
