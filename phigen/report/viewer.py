"""Data for the interactive viewer of a page: trajectories with as many rows and digits as a screen can show."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from markupsafe import Markup

from phigen.drawing.groups import groups
from phigen.drawing.leaf import around, leaf_of, net
from phigen.drawing.phase_space import box_of, joins
from phigen.report import page
from phigen.report.drawable import drawable
from phigen.runtime.trajectory import Trajectory
from phigen.symbolic.arrays import Floats
from phigen.symbolic.expression import Expression

#: MOST_NUMBERS: largest number of values in all curves together. MOST_ROWS: largest number of rows of a curve. The page
#: contains coordinates as integers from 0 to STEPS.
MOST_NUMBERS, MOST_ROWS, STEPS = 90_000, 4_000, 9_999
#: Largest number of curves in the viewer.
CURVES = 2
#: Number of characters to which names of coordinates are cut, since menus and axes are narrow.
LETTERS = 24


def viewer(
    methods: Mapping[str, Trajectory], opening: Mapping[str, Trajectory], casimirs: Mapping[str, Expression]
) -> Markup:
    """Return the viewer of the first two trajectories; empty if no curve can be drawn.

    If the rows of ``methods`` are too far apart to be joined by lines, the viewer shows the trajectories in ``opening``
    instead, which cover only the first steps. If a Casimir depends only on the coordinates that are shown at first, the
    viewer also shows the level set of this Casimir.
    """
    first = next(iter(methods.values()), None)
    if first is None:
        return Markup("")
    axes = _axes(first.coordinates)
    trajectories = opening if opening and not _joined(methods, axes) and _joined(opening, axes) else methods
    until = _until(methods, trajectories)
    curves = {label: curve for label, curve in list(trajectories.items())[:CURVES] if len(_finite(curve)) > 1}
    if not curves:
        return Markup("")
    names = [*(c[:LETTERS] for c in first.coordinates), "t"]
    view_data = _data(curves, names, axes, _leaf(casimirs, next(iter(curves.values())), axes))
    options = list(enumerate(names))
    return page.block(
        "viewer",
        label=f"The trajectory of {', '.join(names)}. Arrow keys turn it, plus and minus zoom, 0 resets.",
        axes=[(axis, options) for axis in "xyz"],
        curves=list(enumerate(curves, start=1)),
        last=len(view_data["curves"][0][0]) - 1,
        until=until,
        data=page.data("viewer-data", view_data),
    )


def _until(methods: Mapping[str, Trajectory], trajectories: Mapping[str, Trajectory]) -> str:
    """Return a sentence that says at which time the curves end; "" if they show the whole run."""
    end, shown_end = (_finite(next(iter(curves.values())))[-1, -1] for curves in (methods, trajectories))
    return f" It shows the first part of the run, up to t = {shown_end:.6g}." if abs(shown_end) < abs(end) else ""


def _joined(methods: Mapping[str, Trajectory], axes: list[int]) -> bool:
    return joins(_finite(next(iter(methods.values())))[:, axes])


def _leaf(casimirs: Mapping[str, Expression], curve: Trajectory, axes: list[int]) -> Floats | None:
    """Return lines on the surface where a Casimir has its value on the trajectory; None if no surface can be drawn.

    The result (points, 3) has the coordinates on the three ``axes``. Rows of NaN separate the lines.
    """
    if not drawable() or len(curve.coordinates) in axes:
        return None
    start = dict(zip(curve.coordinates, curve.x[0].tolist(), strict=True))
    leaf = leaf_of(casimirs, [curve.coordinates[axis] for axis in axes], start, curve.parameters)
    if leaf is None:
        return None
    lines = net(leaf, around(leaf, box_of(_finite(curve)[:, axes])))
    return np.concatenate([part for line in lines for part in (line, np.full((1, 3), np.nan))]) if lines else None


def _data(methods: Mapping[str, Trajectory], names: list[str], axes: list[int], leaf: Floats | None) -> dict[str, Any]:
    tables = [_finite(curve) for curve in methods.values()]
    max_rows = min(MOST_ROWS, max(2, MOST_NUMBERS // (len(tables) * len(names))))
    stride = max(1, -(-max(map(len, tables)) // max_rows))
    tables = [table[::stride] for table in tables]
    low = np.min([table.min(axis=0) for table in tables], axis=0)
    high = np.max([table.max(axis=0) for table in tables], axis=0)
    if leaf is not None:
        low[axes] = np.minimum(low[axes], np.nanmin(leaf, axis=0))
        high[axes] = np.maximum(high[axes], np.nanmax(leaf, axis=0))
    size = np.where(high > low, high - low, 1.0)
    return {
        "names": names,
        "axes": axes,
        "low": [float(f"{v:.9g}") for v in low],
        "high": [float(f"{v:.9g}") for v in high],
        "steps": STEPS,
        "joined": joins(tables[0][:, axes]),
        "curves": [np.rint((table - low) / size * STEPS).astype(int).T.tolist() for table in tables],
        "leaf": None if leaf is None else _integer_columns((leaf - low[axes]) / size[axes] * STEPS),
    }


def _integer_columns(points: Floats) -> list[list[int | None]]:
    """Return the columns of an array as lists of rounded integers, with None for NaN."""
    return [[None if v != v else round(v) for v in column] for column in points.T.tolist()]


def _finite(trajectory: Trajectory) -> Any:
    """Return the rows before the first state that is not finite. The columns are the coordinates, and then the time."""
    nonfinite_rows = np.flatnonzero(~np.isfinite(trajectory.x).all(axis=1))
    end = int(nonfinite_rows[0]) if len(nonfinite_rows) else len(trajectory)
    return np.column_stack([trajectory.x[:end], trajectory.t[:end]])


def _axes(coordinates: tuple[str, ...]) -> list[int]:
    """Return the indices of the three columns that are shown at first.

    They are coordinates of the largest of the `groups`. If that group has fewer than three coordinates, other
    coordinates or the time are added.
    """
    group = max(groups(coordinates), key=len)
    columns = [coordinates.index(c) for c in group][:3]
    other_columns = [i for i in range(len(coordinates)) if i not in columns] if len(columns) > 2 else []
    return ([*columns, *other_columns][:3] + [len(coordinates)] * 3)[:3]
