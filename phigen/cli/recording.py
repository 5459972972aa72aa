"""What becomes of a run while it is integrated: rows in files, errors, sketches for figures, and checkpoints."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np

from phigen._version import __version__
from phigen.cli.console import Console
from phigen.cli.experiment import Experiment
from phigen.cli.interruption import interruptible
from phigen.compilation import Compilation
from phigen.errors import FileError, StepError
from phigen.runtime import checkpoint
from phigen.runtime.checkpoint import Checkpoint, MismatchError
from phigen.runtime.crossings import CrossingFinder, section_columns
from phigen.runtime.interface import BackendError
from phigen.runtime.march import Piece, march
from phigen.runtime.session import Session
from phigen.runtime.solver import Solver
from phigen.runtime.tables import Table, opened
from phigen.runtime.trajectory import Trajectory, element_columns, trajectory_columns
from phigen.study.lyapunov import FrameGrowth, Spectrum
from phigen.study.sections import function_of
from phigen.study.sketch import POINTS, Sketch, Thinned
from phigen.study.summary import Watch
from phigen.symbolic.readable import readable

#: Seconds between two checkpoints.
CHECKPOINT_SECONDS = 2.0


@dataclass(frozen=True)
class Files:
    """Where rows and crossings go, None for nowhere."""

    output: Path | None = None
    section: Path | None = None

    @property
    def checkpoint(self) -> Path | None:
        """Beside the first of them; an integration that leaves no files cannot be gone on with."""
        first = self.output or self.section
        return first.with_name(first.name + ".checkpoint") if first else None


class Recorder:
    """One run: the session that makes its steps, and all that takes in what it gives."""

    def __init__(self, compilation: Compilation, solver: Solver, experiment: Experiment, files: Files, lyapunov: bool):
        self.solver, self.experiment, self.files = solver, experiment, files
        run, parameters, names = experiment.run, experiment.parameters, solver.interface
        self.watch = Watch(self.label, compilation.system, run, parameters, experiment.rows)
        self.sketch = Sketch(names.dimension, len(names.casimirs), experiment.rows)
        self.growth = FrameGrowth(names.dimension, experiment.h) if lyapunov else None
        self.points = Thinned(1 + names.dimension, POINTS)
        self.finder = None
        if run.section is not None:
            section = function_of(run.section, names.coordinates, parameters, names.time)
            self.finder = CrossingFinder[Session](section, experiment.h, experiment.t0, timed=bool(names.time))
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
            "initial": list(experiment.initial),
            **({"start": experiment.t0} if names.time else {}),
            "parameters": parameters,
            "files": [path.name if path else None for path in (files.output, files.section)],
            "lyapunov": lyapunov,
            "solver": solver.backend.identity,
        }
        self.session: Session
        self._tables: dict[str, Table] = {}
        self._saved = time.monotonic()

    @property
    def label(self) -> str:
        """The name of the method."""
        return f"phigen, order {self.solver.order}"

    @property
    def time(self) -> float:
        """The physical time of the state."""
        monitored = self.solver.interface.monitored
        return self.session.time() if monitored else self.experiment.t0 + self.experiment.h * self.session.steps

    @property
    def section_text(self) -> str:
        """The expression of the section, for people."""
        section = self.experiment.run.section
        return readable([section])[0] if section is not None else ""

    @property
    def spectrum(self) -> Spectrum | None:
        """The Lyapunov exponents so far, if they were asked for and a step was made."""
        return self.growth.spectrum() if self.growth and self.session.steps else None

    def start(self) -> None:
        """Stand at the initial state, with new files."""
        initial = np.array(self.experiment.initial)
        try:
            self.session = self.solver.backend.start(initial, self.experiment.parameters, self.experiment.t0)
        except BackendError as error:
            raise self.solver.failure(error, self.experiment.h, None, self.experiment.parameters) from error
        self._open({})

    def resume(self, path: Path) -> None:
        """Stand where the checkpoint stands, with the files as they were then. Raises `MismatchError`."""
        arrays = checkpoint.load(path, self.identity)
        for prefix, part in self._parts().items():
            part.state = {name: arrays[f"{prefix}.{name}"] for name in part.state}
        backend, parameters = self.solver.backend, self.experiment.parameters
        self.session = backend.restored(arrays["session"].tobytes(), parameters)
        if self.finder:
            self.finder.values = arrays["values"].tolist()
            self.finder.past = [backend.restored(past.tobytes(), parameters) for past in arrays["past"]]
        try:
            self._open(arrays)
        except (OSError, ValueError) as error:
            raise MismatchError(f"cannot go on: {error}") from None

    def see(self, piece: Piece) -> None:
        """Take in what a piece of the integration gave."""
        t = self.experiment.t0 + self.experiment.h * piece.numbers.astype(np.float64)
        if self.solver.interface.monitored:
            t = piece.passed
        energy = self.solver.energies(piece.x, t, self.experiment.parameters)
        casimirs = self.solver.backend.casimirs(piece.x, self.experiment.parameters)
        rows = np.column_stack([t, piece.x, energy, casimirs, piece.turned])
        worked = self.watch.see(t, piece.x)
        self.sketch.see(np.column_stack([t, piece.x, energy - worked, casimirs]))
        crossings = np.array([[t, *x] for t, x in piece.crossings]).reshape(-1, 1 + piece.x.shape[1])
        self.points.see(crossings)
        for name, found in (("output", rows), ("section", crossings)):
            if name in self._tables:
                self._tables[name].append(found)

    def save(self, seconds: float = 0.0) -> None:
        """Hand all files over to the disk with a checkpoint, if the last one is so many seconds old."""
        path = self.files.checkpoint
        if path is None or time.monotonic() - self._saved < seconds:
            return
        arrays: dict[str, Any] = {f"size.{name}": table.flush() for name, table in self._tables.items()}
        arrays["session"] = np.frombuffer(self.session.saved(), dtype=np.uint8)
        for prefix, part in self._parts().items():
            arrays |= {f"{prefix}.{name}": value for name, value in part.state.items()}
        if self.finder:
            arrays["values"] = np.array(self.finder.values)
            arrays["past"] = np.array([np.frombuffer(s.saved(), dtype=np.uint8) for s in self.finder.past])
        Checkpoint(self.identity, arrays).save(path)
        self._saved = time.monotonic()

    def finish(self, keep: bool) -> None:
        """Complete the files; ``keep`` what is needed to go on."""
        steps, h, names = self.session.steps, self.experiment.h, np.array(self.solver.coordinates)
        parameters = {f"parameter_{name}": value for name, value in self.experiment.parameters.items()}
        about = {"coordinates": names}
        scalars: dict[str, dict[str, Any]] = {
            "output": {**about, "steps": steps, "h": h, **parameters},
            "section": about,
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
        """Leave nothing of a run that could not even begin."""
        for table in self._tables.values():
            table.discard()

    def trajectory(self, broken: bool) -> Trajectory:
        """As many rows as a figure can show; ``broken`` marks the end of a run that failed."""
        names, about = self.solver.interface, self.experiment
        return self.sketch.trajectory(names.coordinates, names.casimirs, about.h, about.parameters, broken)

    def _parts(self) -> dict[str, Any]:
        parts = {"watch": self.watch, "sketch": self.sketch, "points": self.points, "growth": self.growth}
        return {name: part for name, part in parts.items() if part is not None}

    def _open(self, arrays: Mapping[str, Any]) -> None:
        names = self.solver.interface
        turned = element_columns(names.attitude, position=names.position)
        columns = {"output": trajectory_columns(names.coordinates, names.casimirs, turned),
                   "section": section_columns(names.coordinates)}  # fmt: skip
        for name, path in (("output", self.files.output), ("section", self.files.section)):
            if path:
                size = int(arrays[f"size.{name}"]) if arrays else None
                self._tables[name] = opened(path, columns[name], size)


def opened_recorder(recorder: Recorder, resume: bool, console: Console) -> Recorder:
    """The recorder at its start, or where its checkpoint stands; `click.UsageError` where files say otherwise."""
    path, output = recorder.files.checkpoint, recorder.files.output or recorder.files.section
    if path is None or output is None:
        if resume:
            raise click.UsageError(
                "--resume goes on with files: give those of the interrupted run by --output or --section"
            )
        recorder.start()
        return recorder
    if not resume and path.exists():
        raise click.UsageError(f"{path} is there, of an interrupted run: go on with --resume, or remove it")
    if resume and path.exists():
        try:
            recorder.resume(path)
        except MismatchError as error:
            raise click.UsageError(str(error)) from None
        console.note(f"going on after {recorder.session.steps} of {recorder.experiment.run.steps} steps")
        return recorder
    if resume and output.exists():
        raise click.UsageError(
            f"{output} is there, but not {path}: its run is complete, and there is nothing to go on with"
        )
    try:
        recorder.start()
        recorder.save()
    except OSError:
        recorder.discard()
        raise
    return recorder


@contextmanager
def _kept(recorder: Recorder) -> Iterator[None]:
    """A full disk ends a run as an interrupt does: its last checkpoint is there, to go on from."""
    try:
        yield
    except OSError as error:
        if recorder.files.checkpoint is None:
            raise
        hint = "its last checkpoint is kept; make room, and the same command with --resume goes on from there"
        raise FileError(f"{error.filename}: {error.strerror}\n  hint: {hint}") from error


def record(recorder: Recorder, console: Console) -> tuple[StepError | None, bool]:
    """Integrate to the end, to a step that fails, which is returned, or until interrupted, which is told."""
    experiment, session, start = recorder.experiment, recorder.session, time.perf_counter()
    run, growth, failure = experiment.run, recorder.growth, None
    label = f"{recorder.solver.interface.name}, order {recorder.solver.order}"
    with _kept(recorder), interruptible() as stop, console.progress(label, run.steps) as progress:
        see_tangent = growth.see if growth else None
        begun = recorder.watch.begun
        pieces = march(session, experiment.h, run.steps, run.stride, recorder.finder, see_tangent, begun=begun)
        try:
            for piece in pieces:
                recorder.see(piece)
                if progress:
                    progress(session.steps)
                if stop.requested:
                    break
                recorder.save(CHECKPOINT_SECONDS)
        except BackendError as error:
            trajectory = recorder.trajectory(False)
            failure = recorder.solver.failure(error, experiment.h, trajectory, experiment.parameters)
            failure.__cause__ = error
        interrupted = stop.requested and failure is None and session.steps < run.steps
        if interrupted:
            recorder.save()
        recorder.finish(keep=interrupted)
    console.detail(f"integrated in {time.perf_counter() - start:.3f} s")
    return failure, interrupted


def compared(
    compilation: Compilation, solver: Solver, experiment: Experiment, method: str, console: Console, end: float
) -> tuple[Watch, Trajectory]:
    """A classical method on the same experiment: its errors, and its trajectory as far as a figure can show it.

    It makes as many steps; with a monitor they are equal in t, and end at the same time.
    """
    from phigen.study import classical
    from phigen.study.methods import extended, field_of

    run, parameters, names = experiment.run, experiment.parameters, solver.interface
    start, backend = time.perf_counter(), solver.backend
    h = end / run.steps if solver.interface.monitored else experiment.h
    watch = Watch(method, compilation.system, run, parameters, experiment.rows)
    sketch = Sketch(names.dimension, len(names.casimirs), experiment.rows)

    with console.progress(method, run.steps) as progress:
        x0 = np.array(experiment.initial)
        for numbers, found in classical.pieces_of(
            method, field_of(solver, parameters), extended(solver, x0, experiment.t0), h, run.steps, run.stride
        ):
            x = found[:, : len(x0)]
            t = experiment.t0 + h * numbers.astype(np.float64)
            worked = watch.see(t, x)
            energy, casimirs = solver.energies(x, t, parameters), backend.casimirs(x, parameters)
            sketch.see(np.column_stack([t, x, energy - worked, casimirs]))
            if progress and len(numbers):
                progress(int(numbers[-1]))
    console.detail(f"{method}: {time.perf_counter() - start:.3f} s")
    broken = int(watch.state["good"]) < experiment.rows
    return watch, sketch.trajectory(names.coordinates, names.casimirs, h, parameters, broken)
