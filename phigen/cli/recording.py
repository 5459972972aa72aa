"""Records of a run, written during the integration: rows in files, errors, data for figures, and checkpoints."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import click
import numpy as np

from phigen._version import __version__
from phigen.cli.console import Console
from phigen.cli.experiment import Experiment
from phigen.cli.interruption import interruptible
from phigen.cli.past import begun, columns_of, recorded_columns
from phigen.compilation import Compilation
from phigen.errors import FileError, StepError
from phigen.runtime import checkpoint
from phigen.runtime.checkpoint import Checkpoint, MismatchError, objection
from phigen.runtime.crossings import CrossingFinder, section_columns
from phigen.runtime.interface import BackendError, Floats
from phigen.runtime.march import Piece, march, march_at, standing
from phigen.runtime.origin import origin_of
from phigen.runtime.sections import function_of
from phigen.runtime.session import Session
from phigen.runtime.solver import Solver
from phigen.runtime.tables import TableFile, opened
from phigen.runtime.trajectory import Trajectory
from phigen.study.averages import averages_of
from phigen.study.lyapunov import FrameGrowth, Spectrum
from phigen.study.sketch import POINTS, Sketch, Thinned
from phigen.study.summary import Watch
from phigen.symbolic.readable import readable

_NO_FILES = "--resume continues the files of an interrupted run: name them by --output or --section"

#: Least time between two checkpoints, in seconds.
CHECKPOINT_SECONDS = 2.0
#: Number of rows of a finished run that are recorded at once, so that temporary arrays stay small.
_ROWS = 1 << 14


@dataclass(frozen=True)
class Files:
    """The files to which a run writes its rows (``output``) and its crossings (``section``).

    A file that was not requested is None.
    """

    output: Path | None = None
    section: Path | None = None

    @property
    def checkpoint(self) -> Path | None:
        """Path of the checkpoint, beside the first file; None if there are no files.

        A run without files cannot be continued.
        """
        first = self.output or self.section
        return first.with_name(first.name + ".checkpoint") if first else None


class Recorder:
    """Recorder of one run. It has the session that makes the steps, and stores the results."""

    def __init__(self, compilation: Compilation, solver: Solver, experiment: Experiment, files: Files, lyapunov: bool):
        self.solver, self.experiment, self.files = solver, experiment, files
        run, parameters, names = experiment.run, experiment.parameters, solver.interface
        self.watch = Watch(self.label, compilation.system, run, parameters, experiment.rows)
        self.sketch = Sketch(names.dimension, len(names.casimirs), experiment.rows, len(names.observables))
        self.averages = averages_of(run, len(names.observables))
        column_names = [name for column in columns_of(names) for name in column.names]
        self._columns = recorded_columns(names, run.record)
        self._places = [column_names.index(name) for column in self._columns for name in column.names]
        self.origin = origin_of(compilation.spec, run)
        self.growth = FrameGrowth(names.dimension, experiment.h) if lyapunov else None
        self.points = Thinned(1 + names.dimension, POINTS)
        self.finder = None
        if run.section is not None:
            section = function_of(run.section, names.coordinates, parameters, names.time)
            clock: dict[str, Any] = {"timed": bool(names.time), "direction": run.direction}
            self.finder = CrossingFinder[Session](section, experiment.h, experiment.begin, **clock)
        self.identity = {
            "phigen": __version__,
            "spec": compilation.spec.source_sha256,
            "target": solver.target,
            "method": compilation.label,
            "order": solver.order,
            "run": run.name,
            "step": experiment.h,
            "steps": run.steps,
            "stride": run.stride,
            "record": list(run.record),
            "times": None if experiment.times is None else [*experiment.times[-1:], len(experiment.times)],
            "end": experiment.end.span if experiment.end else None,
            "past": len(experiment.past.rows) if experiment.past else 0,
            "initial": list(experiment.initial),
            **({"start": experiment.t0} if names.time else {}),
            **({"seed": run.seed} if names.noise else {}),
            "parameters": parameters,
            "files": [path.name if path else None for path in (files.output, files.section)],
            "lyapunov": lyapunov,
            "solver": solver.backend.identity,
        }
        self.session: Session
        self.number = 0.0  # number of steps up to the last row, not an integer if this row lies inside a step
        self._whole: int | None = None  # number of whole steps; None until the partial last step has been made
        self._tables: dict[str, TableFile] = {}
        self._saved = time.monotonic()

    @property
    def label(self) -> str:
        """The name of the method, with its order."""
        return f"phigen, order {self.solver.order}"

    @property
    def time(self) -> float:
        """The physical time t of the current state."""
        monitored, experiment = self.solver.interface.monitored, self.experiment
        elapsed = experiment.h * (self.number if self._whole is not None else self.session.steps)
        return experiment.begin + (self.session.time() if monitored else elapsed)

    @property
    def steps(self) -> int:
        """Number of whole steps made."""
        return self._whole if self._whole is not None else self.session.steps

    @property
    def section_text(self) -> str:
        """The expression of the section as readable text; "" if there is no section."""
        section = self.experiment.run.section
        return readable([section])[0] if section is not None else ""

    @property
    def spectrum(self) -> Spectrum | None:
        """The Lyapunov exponents up to now; None if they were not requested, or before the first step."""
        if self.growth is None or not self.steps:
            return None
        return replace(self.growth.spectrum(), clock="τ" if self.solver.interface.monitored else "t")

    def start(self) -> None:
        """Begin the run at its initial state, with new files."""
        self.session = begun(self.solver, self.experiment)
        self._open({})
        if self.experiment.past:
            self._record_past_rows(self.experiment.past.rows)

    def resume(self, path: Path) -> None:
        """Continue from the checkpoint ``path``. Rows that were written after the checkpoint are dropped from the
        files.

        Raises `MismatchError`.
        """
        arrays = checkpoint.load(path, self.identity)
        for prefix, part in self._parts().items():
            part.state = {name: arrays[f"{prefix}.{name}"] for name in part.state}
        backend, parameters = self.solver.backend, self.experiment.parameters
        self.session = backend.restored(arrays["session"].tobytes(), parameters)
        self.number = float(arrays["number"])
        if self.finder:
            self.finder.values = arrays["values"].tolist()
            self.finder.past = [
                backend.restored(saved_session.tobytes(), parameters) for saved_session in arrays["past"]
            ]
        try:
            self._open(arrays)
        except (OSError, ValueError) as error:
            raise MismatchError(f"cannot resume: {error}") from None

    def see(self, rows_piece: Piece) -> None:
        """Record the rows of one piece of the integration, and its crossings of the section."""
        experiment, monitored = self.experiment, self.solver.interface.monitored
        if len(rows_piece.numbers):
            self.number = float(rows_piece.numbers[-1])
        t = experiment.begin + (rows_piece.passed if monitored else experiment.h * rows_piece.numbers)
        energy = self.solver.energies(rows_piece.x, t, self.experiment.parameters)
        casimirs = self.solver.backend.casimirs(rows_piece.x, self.experiment.parameters)
        tau = experiment.past.last(["tau"])[0] if monitored and experiment.past else 0.0
        times = [t, tau + experiment.h * rows_piece.numbers] if monitored else [t]
        observed = self.solver.observed(rows_piece.x, t, self.experiment.parameters)
        self.averages.see(t, observed)
        rows = np.column_stack([*times, rows_piece.x, energy, casimirs, rows_piece.turned, observed])
        self.watch.see(t, rows_piece.x)
        self.sketch.see(np.column_stack([t, rows_piece.x, energy, casimirs, observed]))
        if "output" in self._tables:
            self._tables["output"].append(rows[:, self._places])
        self._record_crossings(rows_piece.crossings)

    def _record_crossings(self, section_points: Sequence[tuple[float, Floats]]) -> None:
        """Record crossings of the section, as pairs of time and state."""
        crossings = np.array([[t, *x] for t, x in section_points]).reshape(-1, 1 + self.solver.interface.dimension)
        self.points.see(crossings)
        if "section" in self._tables:
            self._tables["section"].append(crossings)

    def complete(self) -> None:
        """Make the partial step at the end, if there is one, and record the last state.

        The last state is not recorded a second time if it is in the last row already.
        """
        end, number = self.experiment.end, float(self.session.steps)
        if end is not None:
            session_before = self.session
            self._whole = session_before.steps
            self.session, number = end.finish(session_before)
            if self.finder and number > session_before.steps:
                self._record_crossings(self.finder.within(session_before, number - session_before.steps))
        if number > self.number + 1e-9 * (1 + number):
            self.see(standing(self.session, number))
        self.number = number

    def _record_past_rows(self, rows: Floats) -> None:
        """Record the rows of the finished run that this run continues."""
        names = self.solver.interface
        times = 1 + names.monitored
        state, quantities = (
            slice(times, times + names.dimension),
            slice(times, times + names.dimension + 1 + len(names.casimirs)),
        )
        for start in range(0, len(rows), _ROWS):
            part = rows[start : start + _ROWS]
            self.watch.see(part[:, 0], part[:, state])
            observed = part[:, part.shape[1] - len(names.observables) :]
            self.sketch.see(np.column_stack([part[:, 0], part[:, quantities], observed]))
            if self.files.output and not self._is_appended(self.files.output):
                self._tables["output"].append(part)

    def _is_appended(self, path: Path) -> bool:
        """Whether new rows are appended to the file of the finished run.

        Rows are appended to a ``.csv`` file. A ``.npz`` file is written again when the run is complete.
        """
        return path.suffix.lower() == ".csv"

    def save(self, seconds: float = 0.0) -> None:
        """Write all files and a checkpoint to the disk, unless the last checkpoint is less than ``seconds`` old."""
        path = self.files.checkpoint
        if path is None or time.monotonic() - self._saved < seconds:
            return
        arrays: dict[str, Any] = {f"size.{name}": table.flush() for name, table in self._tables.items()}
        arrays["session"] = np.frombuffer(self.session.saved(), dtype=np.uint8)
        arrays["number"] = np.asarray(self.number)
        for prefix, part in self._parts().items():
            arrays |= {f"{prefix}.{name}": value for name, value in part.state.items()}
        if self.finder:
            arrays["values"] = np.array(self.finder.values)
            arrays["past"] = np.array([np.frombuffer(s.saved(), dtype=np.uint8) for s in self.finder.past])
        Checkpoint(self.identity, arrays).save(path)
        self._saved = time.monotonic()

    def means(self) -> dict[str, tuple[float, float]]:
        """Return the mean and the standard error of each coordinate and of the energy, taken over all members at the
        end of the run.

        The first member is the trajectory of the session. Raises `StepError`.
        """
        experiment, names = self.experiment, self.solver.interface
        run, parameters, steps = experiment.run, experiment.parameters, experiment.made + self.steps
        part = experiment.h * (self.number - self.steps) if self._whole is not None else 0.0
        x = np.tile(np.array(experiment.initial), (run.members, 1))
        for h, steps_before, count in ((experiment.h, 0, steps), (part, steps, 1)):
            if count and h:
                clock: dict[str, Any] = {"t0": experiment.t0 + experiment.h * steps_before} if names.time else {}
                x = self.solver.ensemble(x, h, count, seed=run.seed, step0=steps_before, parameters=parameters, **clock)
        energy = self.solver.energies(x, np.full(len(x), self.time), parameters)
        columns = np.column_stack([x, energy])
        errors = columns.std(axis=0, ddof=1) / np.sqrt(len(x))
        pairs = zip(columns.mean(axis=0).tolist(), errors.tolist(), strict=True)
        return dict(zip([*names.coordinates, "energy"], pairs, strict=True))

    def finish(self, keep: bool) -> None:
        """Complete the files, and remove the checkpoint. With ``keep`` the checkpoint remains, so that the run can
        continue.
        """
        run, names = self.experiment, np.array(self.solver.coordinates)
        time_before = 0.0
        if run.past:
            time_before = run.past.last(["tau"])[0] if self.solver.interface.monitored else run.past.t - run.t0
        steps, h = round(time_before / run.h) + self.steps, run.h
        parameters = {f"parameter_{name}": value for name, value in self.experiment.parameters.items()}
        entries = {"coordinates": names, "origin": np.array(str(self.origin))}
        scalars: dict[str, dict[str, Any]] = {
            "output": {**entries, "steps": steps, "h": h, **parameters},
            "section": entries,
        }
        for name, table in self._tables.items():
            table.close(scalars[name])
        if keep:
            return
        for table in self._tables.values():
            table.clean()
        if self.files.checkpoint:
            self.files.checkpoint.unlink(missing_ok=True)

    def discard(self) -> None:
        """Remove the files of a run that could not start."""
        for table in self._tables.values():
            table.discard()

    def trajectory(self, broken: bool) -> Trajectory:
        """Return the trajectory, thinned to as many rows as a figure can show; ``broken`` says that the run failed."""
        names, experiment = self.solver.interface, self.experiment
        settings = experiment.h, self.steps, experiment.parameters
        return self.sketch.trajectory(names.coordinates, names.casimirs, *settings, broken, names.observables)

    def _parts(self) -> dict[str, Any]:
        parts = {"watch": self.watch, "sketch": self.sketch, "points": self.points, "growth": self.growth}
        parts["averages"] = self.averages if self.solver.interface.observables else None
        return {name: part for name, part in parts.items() if part is not None}

    def _open(self, arrays: Mapping[str, Any]) -> None:
        names = self.solver.interface
        columns = {"output": self._columns, "section": section_columns(names.coordinates)}
        for name, path in (("output", self.files.output), ("section", self.files.section)):
            if path:
                size = int(arrays[f"size.{name}"]) if arrays else None
                if self.experiment.past and self._is_appended(path) and not arrays:
                    size = path.stat().st_size
                self._tables[name] = opened(path, columns[name], size)


def opened_recorder(recorder: Recorder, resume: bool, console: Console) -> Recorder:
    """Start the run of a recorder or, with ``resume``, continue the run from its checkpoint. Return the
    recorder.

    Raises `click.UsageError` if existing files prevent the start, or cannot be continued.
    """
    path, output = recorder.files.checkpoint, recorder.files.output or recorder.files.section
    if path is None or output is None:
        if resume:
            raise click.UsageError(_NO_FILES)
        recorder.start()
        return recorder
    if refused := objection(path, output, resume=resume, how="--resume"):
        raise click.UsageError(refused)
    if resume and path.exists():
        try:
            recorder.resume(path)
        except MismatchError as error:
            raise click.UsageError(str(error)) from None
        console.note(f"resuming after {recorder.steps} of {recorder.experiment.run.steps} steps")
        return recorder
    try:
        recorder.start()
        recorder.save()
    except OSError:
        if recorder.experiment.past is None:
            recorder.discard()
        raise
    return recorder


@contextmanager
def _disk_errors_with_hint(recorder: Recorder) -> Iterator[None]:
    """Context in which an error of the disk, such as lack of space, becomes a `FileError`.

    The message of the `FileError` says how to resume the run. Errors of a run without a checkpoint are not changed.
    """
    try:
        yield
    except OSError as error:
        if recorder.files.checkpoint is None:
            raise
        hint = "the last checkpoint is intact; free some space and repeat the command with --resume"
        raise FileError(f"{error.filename}: {error.strerror}\n  hint: {hint}") from error


def record(recorder: Recorder, console: Console) -> tuple[StepError | None, bool]:
    """Integrate up to the end, a failing step, or an interrupt.

    Returns the failure or None, and whether the run was interrupted.
    """
    experiment, session, start = recorder.experiment, recorder.session, time.perf_counter()
    run, growth, failure = experiment.run, recorder.growth, None
    label = f"{recorder.solver.interface.name}, order {recorder.solver.order}"
    with _disk_errors_with_hint(recorder), interruptible() as stop, console.progress(label, run.steps) as progress:
        see_tangent = growth.see if growth else None
        flags = {"is_started": recorder.watch.begun, "goes_on": experiment.has_part}
        pieces = march(session, experiment.h, run.steps, run.stride, recorder.finder, see_tangent, **flags)
        if experiment.times is not None:
            pieces = _at_times(recorder, session, see_tangent)
        is_complete = False
        try:
            for piece in pieces:
                recorder.see(piece)
                if progress:
                    progress(session.steps)
                if stop.requested:
                    break
                recorder.save(CHECKPOINT_SECONDS)
            else:
                is_complete = True
            is_complete = is_complete or (session.steps == run.steps and experiment.times is None)
            if is_complete:
                recorder.complete()
        except BackendError as error:
            trajectory = recorder.trajectory(False)
            failure = recorder.solver.failure(error, experiment.h, trajectory, experiment.parameters)
            failure.__cause__ = error
        interrupted = stop.requested and failure is None and not is_complete
        if interrupted:
            recorder.save()
        recorder.finish(keep=interrupted)
    console.detail(f"integrated in {time.perf_counter() - start:.3f} s")
    return failure, interrupted


def _at_times(recorder: Recorder, session: Session, see_tangent: Callable[[Floats], None] | None) -> Iterator[Piece]:
    """Integrate from the current state of a session. Yield the parts of the trajectory, with rows at the requested
    times.
    """
    experiment = recorder.experiment
    if not recorder.watch.begun:
        yield standing(session, 0.0)
    rows_seen = recorder.watch.good - (len(experiment.past.rows) if experiment.past else 1)
    yield from march_at(
        session, experiment.h, experiment.run.steps, experiment.spans[rows_seen:], recorder.finder, see_tangent
    )


@dataclass(frozen=True)
class _Rows:
    """Rows at which a classical method is compared with the solver.

    ``numbers`` has one number for each row: the number of steps from the start to that row. A fraction means that the
    row lies inside a step. ``count`` is the number of rows.
    """

    numbers: Iterable[float]
    count: int


def _compared_rows(experiment: Experiment, h: float) -> _Rows:
    """Return the rows at which a classical method is compared. The steps of this method have the size h in t."""
    run, end = experiment.run, experiment.end
    last = end.span / h if end else float(run.steps)
    if experiment.times is not None:
        numbers = [0.0, *(span / h for span in experiment.spans)]
        return _Rows([*numbers, *([last] if experiment.rows > len(numbers) else [])], experiment.rows)
    whole_steps = range(0, run.steps + 1, run.stride)
    last_rows = [last] if experiment.has_part else [float(run.steps)] * (run.steps % run.stride > 0)
    return _Rows(chain(whole_steps, last_rows), len(whole_steps) + len(last_rows))


def compared(
    compilation: Compilation, solver: Solver, experiment: Experiment, method: str, console: Console, end: float
) -> tuple[Watch, Trajectory]:
    """Integrate the experiment by a classical method. Return the errors of the method, and its trajectory for
    figures.

    The method makes as many steps as the solver. If a requested time lies inside a step, the method also makes a
    partial step. If the run has a monitor, the steps of the method are equal in t and end at ``end``.
    """
    from phigen.study import classical
    from phigen.study.methods import extended, field_of

    run, parameters, names = experiment.run, experiment.parameters, solver.interface
    start, backend = time.perf_counter(), solver.backend
    h = end / max(1, run.steps) if solver.interface.monitored else experiment.h
    rows = _compared_rows(experiment, h)
    watch = Watch(method, compilation.system, run, parameters, rows.count)
    sketch = Sketch(names.dimension, len(names.casimirs), rows.count)

    with console.progress(method, run.steps) as progress:
        x0 = np.array(experiment.initial)
        for numbers, states in classical.pieces_of(
            method, field_of(solver, parameters), extended(solver, x0, experiment.t0), h, rows.numbers
        ):
            x = states[:, : len(x0)]
            t = experiment.t0 + h * numbers
            watch.see(t, x)
            energy, casimirs = solver.energies(x, t, parameters), backend.casimirs(x, parameters)
            sketch.see(np.column_stack([t, x, energy, casimirs]))
            if progress and len(numbers):
                progress(int(numbers[-1]))
    console.detail(f"{method}: {time.perf_counter() - start:.3f} s")
    broken = watch.good < rows.count
    if broken:
        watch.break_down()
    return watch, sketch.trajectory(names.coordinates, names.casimirs, h, run.steps, parameters, broken)
