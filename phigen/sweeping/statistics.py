"""Values of observables that a sweep stores for its members: final values, means, standard deviations and errors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from phigen.runtime.interface import BackendError, Floats, row_steps
from phigen.runtime.members import Members
from phigen.runtime.solver import Solver
from phigen.spec.model import Statistic
from phigen.spec.names import STATISTICS
from phigen.study.averages import Averages
from phigen.sweeping.store import Job

#: Members are integrated in groups. This is the largest memory, in bytes, for the states of a group.
MOST_BYTES = 64 * 2**20


def statistics_of(
    job: Job, solver: Solver, members: Members, states: Floats, statistics: Mapping[str, Statistic]
) -> dict[str, Floats]:
    """Return the requested values of observables, by keyword such as mean(M), with one value for each member.

    ``states`` (rows, members, DIM) are the frames of the sweep, or only the final states. Statistics are over the
    frames. If no frames are stored, the members are integrated again, and statistics are over every ``stride``-th step,
    start and end included, as in ``phigen run``. Rows before ``plan.after`` are left out.
    """
    names = list(solver.interface.observables)
    values: dict[str, Floats] = {}
    if any(not s.of for s in statistics.values()):
        last = _values(job, solver, members, states[-1:], np.array([members.steps]))[0]
        values |= {word: last[:, names.index(s.observable)] for word, s in statistics.items() if not s.of}
    over_run = {word: s for word, s in statistics.items() if s.of}
    if over_run:
        results = {of: np.full((len(members), len(names)), np.nan) for of in STATISTICS}
        for part, some, rows, numbers in _member_groups(job, solver, members, states):
            results["mean"][part], results["std"][part] = _moments(job, solver, some, rows, numbers)
            if any(s.of == "error" for s in over_run.values()):
                results["error"][part] = _errors(job, solver, some, rows, numbers)
        values |= {word: results[s.of][:, names.index(s.observable)] for word, s in over_run.items()}
    return values


def _values(job: Job, solver: Solver, members: Members, states: Floats, numbers: Floats) -> Floats:
    """Return the observables (rows, members, observables) of states after the given ``numbers`` of steps."""
    time_arguments: tuple[Any, ...] = ()
    if solver.interface.time:
        time_arguments = (members.t0 + numbers[:, np.newaxis] * members.h,)
    return np.asarray(job.module.observables(states, *time_arguments, **members.parameters), dtype=np.float64)


def _moments(job: Job, solver: Solver, members: Members, rows: Floats, numbers: Floats) -> tuple[Floats, Floats]:
    """Return means and standard deviations of observables over the rows, each (members, observables).

    ``numbers`` are the step numbers of the rows. If all rows are before ``plan.after``, the results are NaN.
    """
    values = _values(job, solver, members, rows, numbers)
    counted = np.ones(values.shape[:2], dtype=bool)
    if job.plan.after is not None:
        t = members.t0 + numbers[:, np.newaxis] * members.h
        counted = np.sign(members.h) * (t - job.plan.after) >= 0
    weights = counted.astype(np.float64)[..., np.newaxis]
    values = np.where(counted[..., np.newaxis], values, 0.0)
    with np.errstate(all="ignore"):
        mean = values.sum(axis=0) / weights.sum(axis=0)
        deviation = np.sqrt((weights * (values - mean) ** 2).sum(axis=0) / (weights.sum(axis=0) - 1))
    return mean, deviation


def _errors(job: Job, solver: Solver, members: Members, rows: Floats, numbers: Floats) -> Floats:
    """Return the standard error (members, observables) of each mean that `_moments` returns.

    The standard errors follow from the means of blocks of rows. ``numbers`` are the step numbers of the rows.
    """
    values = _values(job, solver, members, rows, numbers)
    errors = np.empty(values.shape[1:])
    clock = np.stack(np.broadcast_arrays(members.t0, members.h, np.empty(len(members)))[:2], axis=1)
    clocks, which = np.unique(clock, axis=0, return_inverse=True)
    for k, (t0, h) in enumerate(clocks.tolist()):  # members with the same start and step share one accumulator
        alike = np.flatnonzero(which.reshape(-1) == k)
        columns = values[:, alike].reshape(len(values), -1)
        averages = Averages(columns.shape[1], after=job.plan.after, backwards=h < 0, blocks=job.plan.blocks)
        averages.see(t0 + numbers * h, columns)
        errors[alike] = np.reshape([average.error for average in averages.results()], (len(alike), -1))
    return errors


def _member_groups(
    job: Job, solver: Solver, members: Members, states: Floats
) -> Iterator[tuple[slice, Members, Floats, Floats]]:
    """Yield groups of members whose states fit into memory, as (slice, members, states, step numbers).

    The states (rows, members, DIM) are those over which statistics are taken.
    """
    if job.plan.frames:
        numbers = np.array(job.plan.rows, dtype=np.float64)
        yield slice(None), members, states[: len(numbers)], numbers
        return
    numbers = row_steps(members.steps, job.plan.stride).astype(np.float64)
    room = max(1, MOST_BYTES // (8 * members.x0.shape[1] * len(numbers)))
    for first in range(0, len(members), room):
        part = slice(first, first + room)
        some = replace(members.part(part), stride=job.plan.stride)
        try:
            rows = solver.backend.ensemble(some, 1)
        except BackendError as error:
            rows = error.states
        yield part, some, rows, numbers
