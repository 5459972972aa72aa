"""Conversion of trajectories to datasets of xarray and data frames of pandas, which are optional packages."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from phigen.packages import imported

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from phigen.runtime.lattice import LatticeTrajectory
    from phigen.runtime.trajectory import Trajectory


def to_xarray(trajectory: Trajectory) -> xr.Dataset:
    """Return a trajectory as a Dataset with the variables ``x`` (t, coordinate), ``energy`` (t), ``casimir_NAME`` (t),
    and the observables (t).

    Step size, number of steps and parameters are attributes.
    """
    xarray = imported("xarray")
    dataset: xr.Dataset = xarray.Dataset(
        {
            "x": (("t", "coordinate"), trajectory.x),
            "energy": ("t", trajectory.energy),
            **{f"casimir_{name}": ("t", values) for name, values in trajectory.casimirs.items()},
            **{name: ("t", values) for name, values in trajectory.observables.items()},
            **({"tau": ("t", trajectory.tau)} if trajectory.monitored else {}),
        },
        coords={"t": trajectory.t, "coordinate": list(trajectory.coordinates)},
        attrs={"h": trajectory.h, "steps": trajectory.steps, **_parameters(trajectory)},
    )
    return dataset


def to_pandas(trajectory: Trajectory) -> pd.DataFrame:
    """Return a trajectory as a DataFrame indexed by t, with the columns of the ``.csv`` file that `Trajectory.save`
    writes.

    ``attrs`` of the data frame has the step size, the number of steps and the parameters.
    """
    pandas = imported("pandas")
    names = [name for column in trajectory.columns() for name in column.names]
    frame: pd.DataFrame = pandas.DataFrame(trajectory.rows(), columns=names).set_index(names[0])
    frame.attrs.update({"h": trajectory.h, "steps": trajectory.steps, **_parameters(trajectory)})
    return frame


def lattice_to_xarray(trajectory: LatticeTrajectory) -> xr.Dataset:
    """Return a trajectory of a lattice as a Dataset with the state ``x`` (t, coordinate, *axes) and ``energy`` (t).

    Casimirs, observables, parameters that are arrays, and the bonds of a graph are further variables.
    """
    xarray = imported("xarray")
    interface = trajectory.solver.interface
    axes = trajectory.axes
    arrays = {n: v for n, v in trajectory.parameters.items() if np.ndim(v)}
    shapes: dict[str, tuple[str, ...]] = dict.fromkeys(interface.at_sites, axes) | dict.fromkeys(
        interface.at_bonds, ("bond",)
    )
    numbers = {f"parameter_{n}": v for n, v in trajectory.parameters.items() if n not in arrays}
    dataset: xr.Dataset = xarray.Dataset(
        {
            "x": (("t", "coordinate", *axes), trajectory.x),
            "energy": ("t", trajectory.energy),
            **{f"casimir_{n}": (("t", *axes)[: np.ndim(v)], v) for n, v in trajectory.casimirs.items()},
            **{n: (("t", *axes)[: np.ndim(v)], v) for n, v in trajectory.observables.items()},
            **{f"parameter_{n}": (shapes[n], v) for n, v in arrays.items() if n in shapes},
            **({"bonds": (("bond", "end"), arrays["bonds"])} if "bonds" in arrays else {}),
            **trajectory.transforms(),
        },
        coords={"t": trajectory.t, "coordinate": list(trajectory.coordinates)},
        attrs={"h": trajectory.h, "steps": trajectory.steps, **numbers},
    )
    return dataset


def _parameters(trajectory: Trajectory) -> dict[str, float]:
    return {f"parameter_{name}": value for name, value in trajectory.parameters.items()}
