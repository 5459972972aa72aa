"""Frames of lattices, in memory or in a file, and the runs that compute them, which can resume from checkpoints."""

from __future__ import annotations

import hashlib
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from phigen.reading import opened
from phigen.runtime import checkpoint
from phigen.runtime.checkpoint import Checkpoint, MismatchError
from phigen.runtime.interface import FIRST_DRAWS, Floats, Progress
from phigen.runtime.memory import filled

if TYPE_CHECKING:
    from phigen.runtime.arguments import Beginning
    from phigen.runtime.lattice import LatticeSolver, LatticeTrajectory

#: Suffixes of files that frames can be written to.
STREAMS = (".npy", ".npz")


@dataclass
class LatticeRun:
    """One call of `LatticeSolver.integrate`: frames at the steps ``marks``, of which ``count`` are complete."""

    solver: LatticeSolver
    at: Beginning
    marks: Any
    frames: Frames
    checkpoints: Path | None
    energy: list[float] = field(default_factory=list)
    observed: list[Floats] = field(default_factory=list)
    count: int = 0
    session: Any = None
    saved: Mapping[str, Any] = field(default_factory=dict)  # arrays of the checkpoint, for `LatticeSession.resume`

    def complete(self, progress: Progress | None) -> int:
        """Compute the remaining frames, from a checkpoint if there is one, and return the number of all frames."""
        first = self._resumed()
        self.session = self.solver.started(replace(self.at, x=first))
        if self.count:
            self.session.resume(self.at.h, int(self.marks[self.count - 1]), self.saved)
        else:
            self._store(first)
        for mark in self.marks[self.count :].tolist():
            self.session.advance(self.at.h, mark - self.session.steps)
            self._store(self.session.state())
            self._save(mark)
            if progress:
                progress(mark)
        return self.count

    def expect_place(self, *, resume: bool) -> None:
        """Raise `ValueError` if the files of an interrupted run would be overwritten, or a complete run resumed."""
        if self.checkpoints:
            refused = checkpoint.objection(self.checkpoints, self.frames.path, resume=resume, how="resume=True")
        else:
            refused = self.frames.objection()
        if refused:
            raise ValueError(refused)

    def discard(self) -> None:
        """Remove all files of the run, if it failed or cannot be resumed."""
        self.frames.discard()
        self.forget()

    def forget(self) -> None:
        """Remove the checkpoint."""
        if self.checkpoints:
            self.checkpoints.unlink(missing_ok=True)

    def _store(self, state: Floats) -> None:
        self.frames.put(self.count, state)
        self.record()
        self.count += 1

    def record(self) -> None:
        """Append the energy and the observables of the present state to those of the frames."""
        self.energy.append(self.session.hamiltonian())
        self.observed.append(self.session.observables())

    def _identity(self) -> dict[str, Any]:
        return identity_of(self.solver, self.at, self.marks)

    def _save(self, mark: int) -> None:
        if self.checkpoints:
            self.frames.flush()
            arrays = {"state": self.session.state(), "count": np.array(self.count), "energy": np.array(self.energy)}
            arrays |= {"observed": np.array(self.observed), **self.session.saved()}
            if self.frames.path is None:
                arrays["frames"] = self.frames.array[: self.count]
            Checkpoint(self._identity(), arrays).save(self.checkpoints)

    def _resumed(self) -> Floats:
        """Return the initial state, or restore the frames of a checkpoint and return its state."""
        if self.checkpoints is None or not self.checkpoints.exists():
            return self.at.x
        arrays = checkpoint.load(self.checkpoints, self._identity())
        self.count, self.energy = int(arrays["count"]), arrays["energy"].tolist()
        self.observed = list(arrays["observed"])
        self.frames.restore(arrays.get("frames"), self.count)
        if not np.array_equal(self.frames.array[self.count - 1], arrays["state"], equal_nan=True):
            raise MismatchError(f"the frames beside {self.checkpoints} are not those of its run")
        self.saved = arrays
        return np.asarray(arrays["state"])


def identity_of(solver: LatticeSolver, at: Beginning, marks: Any) -> dict[str, Any]:
    """Return everything that determines the rows of an integration at the steps ``marks``, as plain data."""
    arrays = {name: np.asarray(value) for name, value in at.values.items() if np.ndim(value)}
    numbers = {name: float(value) for name, value in at.values.items() if not np.ndim(value)}
    hashes = {name: hashlib.sha256(a.tobytes()).hexdigest() for name, a in {**arrays, "": at.x}.items()}
    rows = [len(marks), int(marks[-1]), int(marks[min(1, len(marks) - 1)])]
    hashes |= {"t0": at.t0.hex()} if at.t0 else {}
    hashes |= {"draws": repr(at.draws)} if at.draws != FIRST_DRAWS else {}
    about = {"solver": solver.backend.identity, "h": at.h, "sizes": list(at.x.shape), "steps": rows}
    return {**about, "parameters": numbers, "arrays": hashes}


class Frames:
    """Storage of frames: an array in memory, or a file."""

    def __init__(self, path: Path | None, shape: tuple[int, ...]) -> None:
        self.path = path
        self._part = path.with_name(path.name + ".part.npy") if path else None
        self._shape = shape
        self._array: Floats | None = None

    @property
    def array(self) -> Floats:
        """The array of all frames. Raises `LimitError` if it does not fit into memory."""
        if self._array is None:
            if self._part is None:
                self._array = filled(f"{self._shape[0]} frames", self._shape)
            else:
                self._array = np.lib.format.open_memmap(self._part, "w+", np.float64, self._shape)
        return self._array

    def put(self, k: int, state: Floats) -> None:
        """Store frame k."""
        self.array[k] = state

    def first(self, count: int) -> Iterator[Floats]:
        """Iterate over the first ``count`` frames; they can be read after `discard` too."""
        return iter(self.array[:count])

    def flush(self) -> None:
        """Write frames that are in memory only to the disk."""
        if isinstance(self._array, np.memmap):
            self._array.flush()

    def restore(self, frames: Floats | None, count: int) -> None:
        """Restore the first ``count`` frames, from an array or from the file of the interrupted run."""
        if frames is not None:
            self.array[:count] = frames
        elif self._part is not None:
            try:
                with opened(self._part):  # refuses pipes, on which open_memmap would wait
                    self._array = np.lib.format.open_memmap(self._part, "r+")
            except (OSError, ValueError) as error:
                raise MismatchError(
                    f"{self._part}, the frames of the interrupted run, cannot be read: {error}"
                ) from None
            if self._array.shape != self._shape or self._array.dtype != np.float64:
                raise MismatchError(f"{self._part} does not hold the frames of this run")

    def objection(self) -> str:
        """Return why a run without checkpoints may not write its frames here, or "" if it may."""
        return "" if self._part is None else checkpoint.objection_to_frames(self._part)

    def discard(self) -> None:
        """Remove the file of a run that failed; its frames are copied to memory and stay readable."""
        if self._part is not None and self._array is not None:
            self._array = np.array(self._array)
            self._part.unlink(missing_ok=True)

    def finish(self, trajectory: LatticeTrajectory) -> None:
        """Write the file of the frames under its final name; a ``.npz`` holds the rest of the trajectory too."""
        if self.path is None or self._part is None:
            return
        self.flush()
        if self.path.suffix == ".npz":
            trajectory.save(self.path)
            with ExitStack() as last:
                last.callback(self._part.unlink, missing_ok=True)
        else:
            self._part.replace(self.path)


def stream_path(path: str | Path) -> Path:
    """Return a path to which frames can be written. Raises `ValueError` for other suffixes."""
    target = Path(path)
    if target.suffix not in STREAMS:
        raise ValueError(f"frames are written to files that end in {' or '.join(STREAMS)}, not {str(path)!r}")
    return target


def add_member(archive: zipfile.ZipFile, name: str, value: Any) -> None:
    """Add an array to a .npz file."""
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        np.lib.format.write_array(member, np.asarray(value), allow_pickle=False)
