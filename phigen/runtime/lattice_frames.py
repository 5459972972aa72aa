"""Storage of the states of lattices (frames) in memory or in a file, while a run computes them."""

from __future__ import annotations

import hashlib
import shutil
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from phigen.memory import expect_room, filled
from phigen.packages import imported
from phigen.reading import opened
from phigen.runtime import checkpoint
from phigen.runtime.checkpoint import MismatchError
from phigen.runtime.interface import FIRST_DRAWS, Floats, LatticeInterface
from phigen.runtime.tables import Column, write
from phigen.runtime.trajectory import trajectory_columns

if TYPE_CHECKING:
    from phigen.runtime.arguments import Beginning
    from phigen.runtime.lattice import LatticeSession, LatticeSolver, LatticeTrajectory
    from phigen.runtime.lattice_rows import Past

#: Suffixes of files to which a run writes frames one by one (STREAMS), and of files that are written at its end
#: (WHOLE).
STREAMS = (".npy", ".npz")
WHOLE = (".csv", ".zarr")
#: Largest number of columns of a ``.csv`` file with states, since programs for tables are not made for wider files.
MAX_COLUMNS = 1000


class FrameRows:
    """Rows of a run of a lattice, each with a state, its energy and its observables: a
    `phigen.runtime.lattice_run.Sink`.
    """

    def __init__(self, frames: Frames | GrowingFrames, seconds: float = 0.0) -> None:
        self.frames, self.seconds = frames, seconds
        self.energy: list[float] = []
        self.observed: list[Floats] = []

    def __len__(self) -> int:
        return len(self.energy)

    def see(self, sites: LatticeSession) -> None:
        self.frames.put(len(self), sites.state())
        self.record(sites)

    def record(self, sites: LatticeSession) -> None:
        """Append the energy and the observables of a state."""
        self.energy.append(sites.hamiltonian())
        self.observed.append(sites.observables())

    def begin(self, earlier_run: Past) -> None:
        assert earlier_run.x is not None
        for k, state in enumerate(earlier_run.x):
            self.frames.put(k, state)
        columns = [values for name, values in earlier_run.columns.items() if name != "energy"]
        self.energy = earlier_run.columns["energy"].tolist()
        self.observed = list(np.column_stack([np.empty((len(earlier_run.t), 0)), *columns]))

    def saved(self) -> dict[str, Any]:
        self.frames.flush()
        arrays = {"energy": np.array(self.energy), "observed": np.array(self.observed)}
        if self.frames.path is None:
            return {**arrays, "frames": np.array(list(self.frames.first(len(self))))}
        return {**arrays, "frame": self.frames.frame(len(self) - 1)}

    def restore(self, arrays: Mapping[str, Any]) -> None:
        self.energy, self.observed = arrays["energy"].tolist(), list(arrays["observed"])
        self.frames.restore(arrays.get("frames"), len(self))
        if self.frames.path and not np.array_equal(self.frames.frame(len(self) - 1), arrays["frame"], equal_nan=True):
            raise MismatchError(f"the frames of {self.frames.path} are not those of its checkpoint")


class GrowingFrames:
    """States in memory, for runs whose number of frames is not known in advance."""

    path: Path | None = None

    def __init__(self) -> None:
        self._states: list[Floats] = []

    def whole(self, shape: tuple[int, ...]) -> Floats:
        """Return all frames (frames, *shape)."""
        return np.array(self._states).reshape(-1, *shape)

    def frame(self, k: int) -> Floats:
        """Return the state of frame k."""
        return self._states[k]

    def put(self, k: int, state: Floats) -> None:
        """Store the state of frame k. The number k must be the number of frames stored so far.

        Raises `LimitError` if memory does not suffice for twice as many frames.
        """
        if k & (k - 1) == 0:
            expect_room(f"{2 * max(k, 1)} states at crossings", 2 * max(k, 1) * state.nbytes)
        self._states.append(state)

    def first(self, count: int) -> Iterator[Floats]:
        """Iterate over the first ``count`` frames."""
        return iter(self._states[:count])

    def flush(self) -> None:
        """Do nothing: no frame is on the disk."""

    def restore(self, frames: Floats | None, count: int) -> None:
        """Replace all frames by the first ``count`` of ``frames``, or by none if ``frames`` is None."""
        self._states = [] if frames is None else list(frames[:count])


def identity_of(solver: LatticeSolver, beginning: Beginning, rows: Sequence[int | float]) -> dict[str, Any]:
    """Return all settings that determine an integration, as plain data that a checkpoint stores.

    ``rows`` are the numbers by which `RowSteps.described` identifies the rows of the integration.
    """
    arrays = {name: np.asarray(value) for name, value in beginning.values.items() if np.ndim(value)}
    numbers = {name: float(value) for name, value in beginning.values.items() if not np.ndim(value)}
    hashes = {name: hashlib.sha256(a.tobytes()).hexdigest() for name, a in {**arrays, "": beginning.x}.items()}
    hashes |= {"t0": beginning.t0.hex()} if beginning.t0 else {}
    hashes |= {"draws": repr(beginning.draws)} if beginning.draws != FIRST_DRAWS else {}
    identity = {
        "solver": solver.backend.identity,
        "h": beginning.h,
        "sizes": list(beginning.x.shape),
        "steps": list(rows),
    }
    return {**identity, "parameters": numbers, "arrays": hashes}


class Frames:
    """Storage of a known number of frames: an array in memory or, if there is a path, an array that is mapped to a
    file."""

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

    def frame(self, k: int) -> Floats:
        """Return a copy of frame k."""
        return np.array(self.array[k])

    def put(self, k: int, state: Floats) -> None:
        """Store frame k."""
        self.array[k] = state

    def first(self, count: int) -> Iterator[Floats]:
        """Iterate over the first ``count`` frames, which can also be read after `discard`."""
        return iter(self.array[:count])

    def flush(self) -> None:
        """Write frames to the disk if they belong to a file; else do nothing."""
        if isinstance(self._array, np.memmap):
            self._array.flush()

    def restore(self, frames: Floats | None, count: int) -> None:
        """Read the first ``count`` frames of an interrupted run, from the array ``frames`` or, if None, from the
        file."""
        if frames is not None:
            self.array[:count] = frames
        elif self._part is not None:
            try:
                with opened(self._part):  # raises an error for pipes, on which open_memmap would block
                    self._array = np.lib.format.open_memmap(self._part, "r+")
            except (OSError, ValueError) as error:
                raise MismatchError(
                    f"{self._part}, the frames of the interrupted run, cannot be read: {error}"
                ) from None
            if self._array.shape != self._shape or self._array.dtype != np.float64:
                raise MismatchError(f"{self._part} does not hold the frames of this run")

    def objection(self) -> str:
        """Return the reason why a run without checkpoints may not write its frames to the file; "" if it may."""
        return "" if self._part is None else checkpoint.objection_to_frames(self._part)

    def discard(self) -> None:
        """Remove the file of a run that failed, and copy its frames to memory, where they can still be read."""
        if self._part is not None and self._array is not None:
            self._array = np.array(self._array)
            self._part.unlink(missing_ok=True)

    def finish(self, trajectory: LatticeTrajectory) -> None:
        """Give the file of the frames its final name; a ``.npz`` also gets times, energies and the other data of
        ``trajectory``."""
        if self.path is None or self._part is None:
            return
        self.flush()
        if self.path.suffix == ".npz":
            trajectory.save(self.path)
            with ExitStack() as last:
                last.callback(self._part.unlink, missing_ok=True)
        else:
            self._part.replace(self.path)


def stream_path(path: str | Path) -> Path | None:
    """Return the path if frames are written to the file one by one; None if the file is written at the end of
    the run.

    The suffix of the path decides. Raises `ValueError` for suffixes of no known format.
    """
    target = Path(path)
    if target.suffix in WHOLE:
        return None
    if target.suffix not in STREAMS:
        names = ", ".join([*STREAMS, *WHOLE[:-1]]) + f" or {WHOLE[-1]}"
        raise ValueError(f"frames are written to files that end in {names}, not {str(path)!r}")
    return target


def expect_columns(shape: tuple[int, ...]) -> None:
    """Raise `ValueError` if a state of the shape (coordinates, *sizes) has more numbers than a table may have
    columns."""
    if (count := int(np.prod(shape))) > MAX_COLUMNS:
        message = f"a .csv of states would have {count} columns, more than {MAX_COLUMNS}"
        raise ValueError(f"{message}; write states to .npz, or choose few columns by record: [energy, …]")


def site_names(coordinates: Sequence[str], sizes: Sequence[int]) -> tuple[str, ...]:
    """Return column names for the numbers of a state, such as ``q_0_0`` for q at the site (0, 0).

    The names are ordered by coordinate, then by site, with the last axis fastest.
    """
    sites = ["_".join(map(str, site)) for site in np.ndindex(*sizes)]
    return tuple(f"{name}_{site}" for name in coordinates for site in sites)


def state_columns(interface: LatticeInterface, sizes: Sequence[int]) -> list[Column]:
    """Return the columns of a table of states, with energy, Casimirs that are one number, and observables."""
    summed = tuple(n for n, kind in zip(interface.casimirs, interface.casimir_kinds, strict=True) if kind != "sites")
    return trajectory_columns(site_names(interface.coordinates, sizes), summed, (), interface.observables)


def write_whole(path: Path, trajectory: LatticeTrajectory) -> None:
    """Write a trajectory as ``.csv`` or ``.zarr``.

    Raises `ValueError` if a state has more numbers than a ``.csv`` may have columns, or if the path of a ``.zarr``
    exists and is not a Zarr store.
    """
    if path.suffix == ".csv":
        write_table(path, trajectory)
    else:
        _write_store(path, trajectory)


def is_store(path: Path) -> bool:
    """Whether a folder is a Zarr store."""
    return any((path / name).is_file() for name in ("zarr.json", ".zgroup"))


def expect_store(path: Path) -> None:
    """Raise `ValueError` if a Zarr store would replace something that is not a Zarr store."""
    if path.exists() and not is_store(path):
        raise ValueError(f"{path} exists, and is not a Zarr store")


def _write_store(path: Path, trajectory: LatticeTrajectory) -> None:
    """Write the variables of `LatticeTrajectory.to_xarray` as arrays of a Zarr store, with the names of their
    dimensions.

    An old store at the path is replaced only when the new store is complete.
    """
    expect_store(path)
    data = trajectory.to_xarray()
    part = path.with_name(path.name + ".part")
    zarr = imported("zarr")
    root = zarr.open_group(str(part), mode="w", zarr_format=2)
    for name in data.variables:
        values, attributes = data[name].to_numpy(), {"_ARRAY_DIMENSIONS": list(data[name].dims)}
        if values.dtype.kind in "fiu":
            root.create_array(str(name), data=values, fill_value=None, attributes=attributes)
        else:
            root.attrs[str(name)] = values.tolist()
    root.attrs.update({str(name): value for name, value in data.attrs.items()})
    if trajectory.origin:
        root.attrs["origin"] = trajectory.origin
    zarr.consolidate_metadata(str(part))  # xarray warns about Zarr stores without consolidated metadata
    if path.exists():
        shutil.rmtree(path)
    part.rename(path)


def write_table(path: Path, trajectory: LatticeTrajectory) -> None:
    """Write a trajectory as ``.csv``. Raises `ValueError` if the states need more columns than a table may have."""
    expect_columns(trajectory.x.shape[1:])
    interface, shape = trajectory.solver.interface, trajectory.x.shape
    states = trajectory.x.reshape(shape[0], int(np.prod(shape[1:])))
    columns = state_columns(interface, trajectory.x.shape[2:])
    summed = [trajectory.casimirs[c.key.removeprefix("casimir_")] for c in columns if c.key.startswith("casimir_")]
    write(path, columns, np.column_stack([trajectory.t, states, trajectory.energy, *summed, trajectory.observed]), {})


def add_member(archive: zipfile.ZipFile, name: str, value: Any) -> None:
    """Add an array to a .npz file that is open as a zip archive."""
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        np.lib.format.write_array(member, np.asarray(value), allow_pickle=False)
