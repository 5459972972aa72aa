"""Runs of lattices that record numbers instead of states: the energy, Casimirs (sums or products), and observables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from phigen.runtime.interface import Floats
from phigen.runtime.tables import SUFFIXES, Column, write

if TYPE_CHECKING:
    from phigen.runtime.interface import LatticeInterface
    from phigen.runtime.lattice import LatticeSession, LatticeSolver, LatticeTrajectory
    from phigen.runtime.lattice_rows import Past

#: Seconds between two checkpoints. A checkpoint writes a whole state, which takes longer than a step of a large
#: lattice.
CHECKPOINT_SECONDS = 2.0


@dataclass(frozen=True, eq=False)
class LatticeSeries:
    """Numbers recorded along one integration: times ``t`` (rows,), and ``columns`` (rows,) by name, such as the energy.

    ``first`` and ``last`` are the states (coordinates, *sizes) at the start and at the end, after ``steps`` steps of
    size ``h`` and possibly a shorter step. ``crossings`` has the recorded quantities at the crossings of the run's
    section. ``origin`` is the provenance text for files.
    """

    t: Floats
    columns: Mapping[str, Floats]
    first: Floats
    last: Floats
    steps: int
    h: float
    parameters: Mapping[str, Any]
    solver: LatticeSolver = field(repr=False)
    crossings: LatticeSeries | None = field(default=None, repr=False)
    origin: str = field(default="", repr=False)

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
        """The trajectory of two frames: the first and the last state."""
        return self.solver.ends_of(self)

    def save(self, path: str | Path) -> None:
        """Write a ``.csv`` with the times and all recorded columns, or a ``.npz`` that also has the first and last
        state and the parameters.

        The arrays of an ``.npz`` are t, energy, casimir_NAME, observable_NAME, first, last, coordinates, axes, steps, h
        and parameter_NAME. Raises `ValueError` for other suffixes.
        """
        interface = self.solver.interface
        columns = [Column("t", ("t",), flat=True)]
        columns += [Column(key_of(name, interface), (name,), flat=True) for name in self.columns]
        scalars = {"first": self.first, "last": self.last}
        scalars |= {"coordinates": np.array(interface.coordinates), "axes": np.array(interface.axes)}
        scalars |= {"origin": np.array(self.origin)} if self.origin else {}
        scalars |= {"steps": np.array(self.steps), "h": np.array(self.h)}
        scalars |= {f"parameter_{name}": np.asarray(value) for name, value in self.parameters.items()}
        write(path, columns, np.column_stack([self.t, *self.columns.values()]), scalars)


def key_of(name: str, interface: LatticeInterface) -> str:
    """Return the name of the array in a ``.npz`` for a recorded quantity, such as ``casimir_C`` for the Casimir C."""
    if name in interface.observables:
        return f"observable_{name}"
    return f"casimir_{name}" if name in interface.casimirs else name


def recordable(interface: LatticeInterface) -> tuple[str, ...]:
    """Return the names of the quantities that a run may record: those that are one number for a state."""
    summed = (name for name, kind in zip(interface.casimirs, interface.casimir_kinds, strict=True) if kind != "sites")
    return ("energy", *summed, *interface.observables)


def series_of(trajectory: LatticeTrajectory) -> LatticeSeries:
    """Return the energy and the observables of a trajectory as a `LatticeSeries`, with its first and its last state."""
    x, solver = trajectory.x, trajectory.solver
    columns = {"energy": trajectory.energy}
    columns |= {name: trajectory.observed[:, k] for k, name in enumerate(solver.interface.observables)}
    settings = trajectory.steps, trajectory.h, trajectory.parameters
    return LatticeSeries(trajectory.t, columns, x[0], x[-1], *settings, solver)


class NumberRows:
    """Rows of a run with quantities that ``names`` lists, but without states: a `phigen.runtime.lattice_run.Sink`."""

    def __init__(self, interface: LatticeInterface, names: Sequence[str]) -> None:
        self.about, self.names, self.seconds = interface, names, CHECKPOINT_SECONDS
        self.rows: list[list[float]] = []

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def columns(self) -> dict[str, Floats]:
        """The recorded values (rows,) by name."""
        values = np.array(self.rows).reshape(len(self.rows), len(self.names))
        return {name: values[:, k] for k, name in enumerate(self.names)}

    def see(self, sites: LatticeSession) -> None:
        self.rows.append(_recorded_columns(sites, self.about, self.names))

    def begin(self, earlier_run: Past) -> None:
        self.rows = np.column_stack([earlier_run.columns[name] for name in self.names]).tolist()

    def saved(self) -> dict[str, Any]:
        return {"rows": np.array(self.rows).reshape(len(self.rows), len(self.names))}

    def restore(self, arrays: Mapping[str, Any]) -> None:
        self.rows = arrays["rows"].tolist()


def _recorded_columns(session: LatticeSession, interface: LatticeInterface, names: Sequence[str]) -> list[float]:
    """Return the quantities that ``names`` lists, in this order, at the state of a session."""
    from phigen.runtime.lattice import reduced

    values = {"energy": session.hamiltonian()} if "energy" in names else {}
    if any(name in interface.observables for name in names):
        values |= dict(zip(interface.observables, session.observables().tolist(), strict=True))
    if summed := [name for name in names if name in interface.casimirs]:
        kinds = zip(interface.casimirs, interface.casimir_kinds, session.casimirs(), strict=True)
        values |= {name: reduced(kind, densities) for name, kind, densities in kinds if name in summed}
    return [values[name] for name in names]


def expect_table(path: str | Path) -> Path:
    """Return the path if its suffix is .csv or .npz. Raises `ValueError` for other suffixes."""
    if Path(path).suffix.lower() not in SUFFIXES:
        raise ValueError(f"columns go to files that end in {' or '.join(SUFFIXES)}, not {str(path)!r}")
    return Path(path)
