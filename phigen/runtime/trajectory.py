"""Results of integrations: the class `Trajectory`, and the columns of the tables in which trajectories are saved."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from phigen.display import display
from phigen.runtime import arguments
from phigen.runtime.interface import Floats, Interface
from phigen.runtime.tables import Column, write
from phigen.targets.names import identifiers
from phigen.targets.reserved import Reserved

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure

    from phigen.runtime.solver import Solver


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States of one integration. Row 0 is the initial state, the last row the final state.

    ``t`` (rows,) are the times, ``x`` (rows, DIM) the states, ``energy`` (rows,) the values of H; ``casimirs`` and
    ``observables`` map names to values (rows,). The integration made ``steps`` steps of size ``h``, with a row after
    every stride-th step and after the last. If the spec has a monitor, which rescales time by dt = g dτ, h is a step in
    τ, and ``tau`` (rows,) are the values of τ; otherwise ``tau`` is ``t``. ``retried`` are the indices, from 0 on, of
    those steps that failed and were repeated as smaller steps. If the spec says ``reconstruct``, ``attitude`` has a
    quaternion (w, x, y, z) or an n × n matrix in each row, and ``position`` has the shape (rows, 3).
    """

    t: Floats
    x: Floats
    energy: Floats
    casimirs: Mapping[str, Floats]
    steps: int
    h: float
    parameters: Mapping[str, float]
    coordinates: tuple[str, ...]
    attitude: Floats | None = None
    position: Floats | None = None
    tau: Floats = field(default_factory=lambda: np.empty(0))
    retried: tuple[int, ...] = ()
    solver: Solver | None = field(default=None, repr=False)
    observables: Mapping[str, Floats] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if len(self.tau) != len(self.t):
            object.__setattr__(self, "tau", self.t)

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        names = ", ".join(self.coordinates)
        return f"<Trajectory of ({names}): {self.steps} steps of {self.h!r}, {len(self)} rows>"

    def _repr_html_(self) -> str:
        """Return a table for notebooks: the first and the last row, and the errors of conserved quantities."""
        return cast(str, display("page of a trajectory")(self))

    def plot(self) -> Figure:
        """Return a figure of the orbit in phase space, and of the errors of energy and Casimirs over time.

        Notebooks show it; ``.savefig(path)`` writes it. Raises `MissingPackageError` without matplotlib.
        """
        return cast("Figure", display("figure of runs")({"phigen": self}, {}))

    def to_xarray(self) -> xr.Dataset:
        """Return an `xarray.Dataset` with the variables ``x`` (t, coordinate), ``energy`` (t), ``casimir_NAME`` (t),
        and the observables (t).

        The step size and the parameters are attributes. Raises `MissingPackageError` without xarray.
        """
        from phigen.runtime.exchange import to_xarray

        return to_xarray(self)

    def to_pandas(self) -> pd.DataFrame:
        """Return a `pandas.DataFrame` indexed by t, with the columns of the ``.csv`` file that `save` writes.

        Raises `MissingPackageError` without pandas.
        """
        from phigen.runtime.exchange import to_pandas

        return to_pandas(self)

    def column(self, coordinate: str) -> Floats:
        """Return the values (rows,) of one coordinate. Raises `KeyError` if there is no coordinate of that name."""
        if coordinate not in self.coordinates:
            raise KeyError(f"{coordinate!r} is not a coordinate; there are {', '.join(self.coordinates)}")
        return self.x[:, self.coordinates.index(coordinate)]

    def at(self, times: ArrayLike) -> Floats:
        """Return the states (times, DIM) at given times, computed by steps of the same method from the nearest
        row.

        States are not interpolated: a shorter last step ends at the given time, so the Casimirs keep their values. With
        noise, each of the times must be the time of a row; otherwise each must be in the range of t. Raises
        `ValueError` if a time is not possible, and `StepError` if a step fails.
        """
        if self.solver is None:
            raise TypeError("this trajectory was not made by a solver of phigen")
        return self.solver.states_at(self, arguments.times_within(times, self.t))

    def save(self, path: str | Path) -> None:
        """Write the trajectory to a file, whose suffix selects the format. Raises `ValueError` for other
        suffixes.

        A ``.csv`` has the columns ``t,x1,…,energy,C…`` and one line per row; every float reads back as the same float.
        A ``.npz`` has the arrays t, x, energy, casimir_NAME, observable_NAME, coordinates, and steps, h, parameter_NAME
        as scalars. With a monitor (rescaled time: dt = g dτ), a column or array ``tau`` follows t.
        """
        write(path, self.columns(), self.rows(), self.scalars())

    @property
    def monitored(self) -> bool:
        """Whether a monitor rescales the time by dt = g dτ, so that steps have equal size in τ, not in t."""
        return self.tau is not self.t

    @property
    def moving(self) -> frozenset[str]:
        """Names of the quantities (``energy``, Casimirs) that are not constant, due to forces or a time-dependent H.

        Figures show the values of these quantities instead of errors, since changes of the values are not errors.
        """
        return self.solver.interface.moving if self.solver else frozenset()

    def columns(self) -> list[Column]:
        """Return the columns of the table of this trajectory, in the order of the array that `rows` returns."""
        shape = () if self.attitude is None else self.attitude.shape[1:]
        attitude_columns = element_columns(shape, position=self.position is not None)
        observed = tuple(self.observables)
        return trajectory_columns(
            self.coordinates, tuple(self.casimirs), attitude_columns, observed, monitored=self.monitored
        )

    def rows(self) -> Floats:
        """Return all values (rows, columns) as they are written to files, in the order of `columns`."""
        attitude_rows = [] if self.attitude is None else [self.attitude.reshape(len(self), -1)]
        attitude_rows += [] if self.position is None else [self.position]
        times = [self.t, self.tau] if self.monitored else [self.t]
        return np.column_stack(
            [*times, self.x, self.energy, *self.casimirs.values(), *attitude_rows, *self.observables.values()]
        )

    def scalars(self) -> dict[str, Any]:
        """Return the entries of a ``.npz`` besides the columns: the names of the coordinates, the number of steps, the
        step size h, and the parameters.
        """
        entries = {"coordinates": np.array(self.coordinates), "steps": self.steps, "h": self.h}
        return {**entries, **{f"parameter_{name}": value for name, value in self.parameters.items()}}


class Turned(NamedTuple):
    """Result of `Solver.attitudes`: states, attitudes, and positions (None if the spec reconstructs no position)."""

    x: Floats
    attitude: Floats
    position: Floats | None


def turned_into(interface: Interface, elements: Floats) -> tuple[Floats | None, Floats | None]:
    """Split arrays ``elements`` (…, components) into attitudes (…, *shape) and positions (…, 3).

    An attitude or a position that the system does not have is returned as None.
    """
    if not interface.attitude:
        return None, None
    size = math.prod(interface.attitude)
    attitude = elements[..., :size].reshape(*elements.shape[:-1], *interface.attitude)
    return attitude, elements[..., size:] if interface.position else None


def element_columns(shape: tuple[int, ...], *, position: bool) -> list[Column]:
    """Return the columns for attitudes of the given ``shape``; there are none for the shape ().

    If ``position`` is true, the columns for positions follow.
    """
    if not shape:
        return []
    rows = range(1, shape[0] + 1)
    letters = "wxyz" if len(shape) == 1 else [f"{i}_{j}" for i in rows for j in rows]
    columns = [Column("attitude", tuple(f"attitude_{a}" for a in letters))]
    return columns + ([Column("position", tuple(f"position_{a}" for a in "xyz"))] if position else [])


def trajectory_columns(
    coordinates: tuple[str, ...],
    casimirs: tuple[str, ...],
    attitude_columns: Sequence[Column] = (),
    observables: tuple[str, ...] = (),
    *,
    monitored: bool = False,
) -> list[Column]:
    """Return the columns of a table of states, the observables last.

    Names of columns are distinct: a coordinate with the name ``t`` gets the column ``t_``.
    """
    times = [Column(name, (name,), flat=True) for name in (["t", "tau"] if monitored else ["t"])]
    reserved_names = [name for column in [*times, *attitude_columns] for name in column.names]
    reserved = Reserved(frozenset(["energy", *reserved_names]))
    column_names = tuple(identifiers(coordinates, reserved).values())
    first = [*times, Column("x", column_names), Column("energy", ("energy",), flat=True)]
    casimir_names = identifiers(casimirs, reserved | column_names)
    casimir_columns = [Column(f"casimir_{name}", (casimir_names[name],), flat=True) for name in casimirs]
    observed = identifiers(observables, reserved | column_names | casimir_names.values())
    return [
        *first,
        *casimir_columns,
        *attitude_columns,
        *(Column(f"observable_{o}", (observed[o],), flat=True) for o in observables),
    ]
