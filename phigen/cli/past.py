"""Runs that start at the last state of another run. The state is read from the file of the other run."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import click
import numpy as np

from phigen.cli.experiment import Experiment
from phigen.reading import opened, opened_text
from phigen.runtime.interface import BackendError, Draws, Floats, Interface
from phigen.runtime.session import Session
from phigen.runtime.solver import Solver
from phigen.runtime.tables import Column
from phigen.runtime.trajectory import element_columns, trajectory_columns

#: Two times count as equal if they differ by less than this fraction of the elapsed time.
_EQUAL = 1e-9


@dataclass(frozen=True)
class StoredRows:
    """Rows of a finished run, read from its file.

    ``columns`` has the names of the columns. The first column is the time.
    """

    columns: tuple[str, ...]
    rows: Floats

    @property
    def t(self) -> float:
        """The time at the end of the finished run."""
        return float(self.rows[-1, 0])

    def last(self, names: Sequence[str]) -> Floats:
        """Return the values of some columns in the last row. Raises `KeyError` for a column that is absent."""
        column_numbers = {name: i for i, name in enumerate(self.columns)}
        return np.array([self.rows[-1, column_numbers[name]] for name in names])


def columns_of(names: Interface) -> list[Column]:
    """Return all columns that the file of a run may have."""
    attitude_columns = element_columns(names.attitude, position=names.position)
    return trajectory_columns(
        names.coordinates, names.casimirs, attitude_columns, names.observables, monitored=names.monitored
    )


def recorded_columns(names: Interface, record: Sequence[str]) -> list[Column]:
    """Return the columns that a run records: times, and the columns that ``record`` names.

    If ``record`` is empty, all columns are recorded.
    """
    if not record:
        return columns_of(names)
    attitude_keys = [column.key for column in element_columns(names.attitude, position=names.position)]
    keys = {"t", "tau"} | ({"x", *attitude_keys} if "state" in record else set())
    keys |= {form.format(name) for name in record for form in ("{}", "casimir_{}", "observable_{}")}
    return [column for column in columns_of(names) if column.key in keys]


def past_of(path: Path, names: Interface, option: str) -> StoredRows:
    """Return the rows that a run has written to the file ``path``.

    Raises `click.BadParameter` with the name ``option`` if the file is not that of a run.
    """
    try:
        stored_rows = _of_npz(path, names) if path.suffix.lower() == ".npz" else _of_csv(path)
        if len(stored_rows.rows):
            _expect_rows(stored_rows, [n for c in columns_of(names)[: 2 + names.monitored] for n in c.names])
            return stored_rows
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        problem = f"it has no column {error}" if isinstance(error, KeyError) else str(error)
        raise click.BadParameter(f"{path} does not hold a run of {names.name}: {problem}", param_hint=option) from None
    raise click.BadParameter(f"{path} has no rows", param_hint=option)


def _expect_rows(stored_rows: StoredRows, needed_columns: Sequence[str]) -> None:
    """Raise `ValueError` for rows from which no run can be continued, and `KeyError` for a missing column.

    A run can be continued only if the values of ``needed_columns`` in the last row are finite.
    """
    if (
        stored_rows.rows.dtype != np.float64
        or stored_rows.rows.ndim != 2
        or stored_rows.rows.shape[1] != len(stored_rows.columns)
    ):
        raise ValueError(f"it has {len(stored_rows.columns)} names of columns, and rows of another length")
    if len(set(stored_rows.columns)) < len(stored_rows.columns):
        raise ValueError("two columns have the same name")
    if not np.isfinite(stored_rows.last(needed_columns)).all():
        raise ValueError("its last state is not finite")


def _of_csv(path: Path) -> StoredRows:
    with opened_text(path) as file:
        header = tuple(file.readline().strip().split(","))
        begin = file.readline()
        rows = np.loadtxt(chain([begin], file), delimiter=",", ndmin=2) if begin.strip() else np.zeros((0, len(header)))
    return StoredRows(header, rows)


def _of_npz(path: Path, names: Interface) -> StoredRows:
    with opened(path) as file, np.load(file, allow_pickle=False) as archive:
        stored_columns = [(column, archive[column.key]) for column in columns_of(names) if column.key in archive]
    for column, values in stored_columns:
        shape = values.shape[:1] if column.flat else (*values.shape[:1], len(column.names))
        if values.dtype.kind not in "fiu" or not values.ndim or values.shape != shape:
            raise ValueError(f"{column.key} is not an array of {len(column.names)} real numbers in each row")
    header = tuple(name for column, _ in stored_columns for name in column.names)
    return StoredRows(header, np.column_stack([values for _, values in stored_columns]).astype(np.float64))


def started_from(experiment: Experiment, rows: StoredRows, solver: Solver) -> Experiment:
    """Return the experiment, changed so that it starts at the last state in ``rows``.

    If ``rows`` has an attitude, the experiment starts with that attitude. If H depends on the time, the experiment
    starts at the time of that state.
    """
    names = solver.interface
    _, *columns = columns_of(names)
    state = next(rows.last(column.names) for column in columns if column.key == "x")
    attitude_names = [
        name for column in element_columns(names.attitude, position=names.position) for name in column.names
    ]
    first = rows.last(attitude_names) if attitude_names and set(attitude_names) <= set(rows.columns) else None
    run = replace(experiment.run, start=type(experiment.run.start)(rows.t)) if names.time else experiment.run
    return replace(experiment, run=run, initial=tuple(state.tolist()), first=first)


def begun(solver: Solver, experiment: Experiment) -> Session:
    """Return a session of the solver, at the state from which the steps of an experiment start.

    If the experiment continues a finished run, the session starts at the last state of the finished run. It also has
    the gauge of the finished run or, with a monitor, the energy level of the finished run.
    """
    backend, stored_rows, names = solver.backend, experiment.past, solver.interface
    initial = np.array(experiment.initial)
    draws = Draws(experiment.run.seed, step=experiment.made if names.noise else 0)
    try:
        if stored_rows is None:
            return backend.start(initial, experiment.parameters, experiment.t0, experiment.first, draws)
        experiment_here = started_from(experiment, stored_rows, solver)
        session = backend.start(
            initial, experiment.parameters, stored_rows.t if names.time else 0.0, experiment_here.first, draws
        )
        if names.monitored:
            return session.placed(np.array(experiment_here.initial))
        session.place(np.array(experiment_here.initial))
        return session
    except BackendError as error:
        raise solver.failure(error, experiment.h, None, experiment.parameters) from error


def extended(experiment: Experiment, path: Path, solver: Solver) -> Experiment:
    """Return the experiment that continues a finished run, whose rows are in the file ``path``.

    Raises a `click.UsageError` for the file of another run, and for a run that cannot be continued from its file.
    """
    names = solver.interface
    if experiment.run.record:
        reason = "has the key `record`, and the file of the run lacks values that a continuation needs"
        message = f"the run {experiment.run.name} {reason}"
        raise click.UsageError(f"--extend: {message}; --from continues from a file that has the state")
    stored = past_of(path, names, "--extend")
    expected = [name for column in columns_of(names) for name in column.names]
    state = names.dimension + 1 + names.monitored
    begin = stored.rows[0, :state].tolist()
    if list(stored.columns) != expected or begin != [experiment.t0, *[0.0] * names.monitored, *experiment.initial]:
        message = f"{path} is of another run: its first row is {', '.join(map(repr, begin))}"
        raise click.BadParameter(message, param_hint="--extend")
    continued = replace(experiment, past=stored)
    missed = stored.t - continued.t0 - continued.made * continued.h
    if continued.run.members > 1 and abs(missed) > _EQUAL * continued.made * abs(continued.h):
        message = (
            f"{path} ends with a shorter step, at t = {stored.t!r}, from which means over members cannot be continued"
        )
        raise click.BadParameter(f"{message}; run it again from the start, to the new end", param_hint="--extend")
    return continued
