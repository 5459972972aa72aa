"""Runs of lattices that record numbers in place of frames: energy, sums and products of Casimirs, observables."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from phigen.runtime import checkpoint
from phigen.runtime.checkpoint import Checkpoint
from phigen.runtime.interface import Floats, Progress
from phigen.runtime.lattice_frames import identity_of
from phigen.runtime.tables import SUFFIXES, Column, write

if TYPE_CHECKING:
    from phigen.runtime.arguments import Beginning
    from phigen.runtime.interface import LatticeInterface
    from phigen.runtime.lattice import LatticeSolver, LatticeTrajectory

#: Seconds between two checkpoints. Each writes a whole state, which for large lattices takes longer than a step.
CHECKPOINT_SECONDS = 2.0


@dataclass(frozen=True, eq=False)
class LatticeSeries:
    """Numbers along one integration: ``t`` (rows,) and ``columns`` by name, (rows,) each.

    ``first`` and ``last`` are the states (coordinates, *sizes) where it began and ended, after ``steps`` steps of size
    ``h``.
    """

    t: Floats
    columns: Mapping[str, Floats]
    first: Floats
    last: Floats
    steps: int
    h: float
    parameters: Mapping[str, Any]
    solver: LatticeSolver = field(repr=False)

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        sizes = "×".join(map(str, self.first.shape[1:]))
        return f"<LatticeSeries of {', '.join(self.columns)} on {sizes} sites: {len(self)} rows>"

    @property
    def observables(self) -> dict[str, Floats]:
        """The recorded observables (rows,) by name."""
        return {name: v for name, v in self.columns.items() if name in self.solver.interface.observables}

    @property
    def ends(self) -> LatticeTrajectory:
        """The trajectory of two frames, the first and the last state."""
        return self.solver.ends_of(self)

    def save(self, path: str | Path) -> None:
        """Write ``.csv`` (t and the columns) or ``.npz``, which holds the last state and the parameters too.

        Keys of the latter are t, energy, casimir_NAME, observable_NAME, last, coordinates, axes, steps, h and
        parameter_NAME. Raises `ValueError` for other suffixes.
        """
        about = self.solver.interface
        columns = [Column("t", ("t",), flat=True)]
        columns += [Column(key_of(name, about), (name,), flat=True) for name in self.columns]
        scalars = {"last": self.last, "coordinates": np.array(about.coordinates), "axes": np.array(about.axes)}
        scalars |= {"steps": np.array(self.steps), "h": np.array(self.h)}
        scalars |= {f"parameter_{name}": np.asarray(value) for name, value in self.parameters.items()}
        write(path, columns, np.column_stack([self.t, *self.columns.values()]), scalars)


def key_of(name: str, about: LatticeInterface) -> str:
    """Return the name of a column in a ``.npz``."""
    if name in about.observables:
        return f"observable_{name}"
    return f"casimir_{name}" if name in about.casimirs else name


def recordable(about: LatticeInterface) -> tuple[str, ...]:
    """Return the names of all numbers that a run may record."""
    summed = (name for name, kind in zip(about.casimirs, about.casimir_kinds, strict=True) if kind != "sites")
    return ("energy", *summed, *about.observables)


def series_of(trajectory: LatticeTrajectory) -> LatticeSeries:
    """Return the energy and the observables of a trajectory as a series."""
    x, solver = trajectory.x, trajectory.solver
    columns = {"energy": trajectory.energy}
    columns |= {name: trajectory.observed[:, k] for k, name in enumerate(solver.interface.observables)}
    settings = trajectory.steps, trajectory.h, trajectory.parameters
    return LatticeSeries(trajectory.t, columns, x[0], x[-1], *settings, solver)


@dataclass
class SeriesRun:
    """One call of `LatticeSolver.series`: ``rows`` of the columns ``names`` at the steps ``marks``."""

    solver: LatticeSolver
    at: Beginning
    marks: Any
    names: Sequence[str]
    checkpoints: Path | None
    rows: list[list[float]] = field(default_factory=list)
    session: Any = None

    def complete(self, progress: Progress | None) -> LatticeSeries:
        """Compute the remaining rows, and return the series. Raises `BackendError`."""
        first, saved = self._resumed()
        self.session, seen = self.solver.started(replace(self.at, x=first)), time.monotonic()
        read = _reader(self.session, self.solver.interface, self.names)
        if saved:
            self.session.resume(self.at.h, int(self.marks[len(self.rows) - 1]), saved)
        else:
            self.rows.append(read())
        for mark in self.marks[len(self.rows) :].tolist():
            self.session.advance(self.at.h, mark - self.session.steps)
            self.rows.append(read())
            if self.checkpoints and time.monotonic() - seen >= CHECKPOINT_SECONDS:
                self._save()
                seen = time.monotonic()
            if progress:
                progress(mark)
        return self.series(int(self.marks[-1]))

    def series(self, steps: int) -> LatticeSeries:
        """Return the series recorded so far; the state of the session is that after ``steps`` steps."""
        t = np.asarray(self.at.t0 + self.at.h * self.marks[: len(self.rows)], dtype=np.float64)
        values = np.array(self.rows).reshape(len(self.rows), len(self.names))
        columns = {name: values[:, k] for k, name in enumerate(self.names)}
        last = self.session.state()
        return LatticeSeries(t, columns, self.at.x, last, steps, self.at.h, self.at.values, self.solver)

    def _identity(self) -> dict[str, Any]:
        return {**identity_of(self.solver, self.at, self.marks), "record": list(self.names)}

    def _save(self) -> None:
        assert self.checkpoints
        arrays = {"state": self.session.state(), "rows": np.array(self.rows), **self.session.saved()}
        Checkpoint(self._identity(), arrays).save(self.checkpoints)

    def _resumed(self) -> tuple[Floats, Mapping[str, Any]]:
        """Return the initial state and {}, or the state and the arrays of the checkpoint if there is one."""
        if self.checkpoints is None or not self.checkpoints.exists():
            return self.at.x, {}
        arrays = checkpoint.load(self.checkpoints, self._identity())
        self.rows = arrays["rows"].tolist()
        return np.asarray(arrays["state"]), arrays


def _reader(session: Any, about: LatticeInterface, names: Sequence[str]) -> Callable[[], list[float]]:
    """Return a function that reads the columns of a session, and computes no others."""
    from phigen.runtime.lattice import reduced

    observed = [name for name in names if name in about.observables]
    summed = [name for name in names if name in about.casimirs]

    def read() -> list[float]:
        values = {"energy": session.hamiltonian()} if "energy" in names else {}
        if observed:
            values |= dict(zip(about.observables, session.observables().tolist(), strict=True))
        if summed:
            kinds = zip(about.casimirs, about.casimir_kinds, session.casimirs(), strict=True)
            values |= {name: reduced(kind, densities) for name, kind, densities in kinds if name in summed}
        return [values[name] for name in names]

    return read


def expect_table(path: str | Path) -> Path:
    """Return the path of a file of columns. Raises `ValueError` for any other."""
    if Path(path).suffix.lower() not in SUFFIXES:
        raise ValueError(f"columns go to files that end in {' or '.join(SUFFIXES)}, not {str(path)!r}")
    return Path(path)
