"""Trajectories in phase space: planes, space with the leaf of a Casimir, coordinates over time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from phigen.analysis.arrays import Floats
from phigen.analysis.drawing.groups import Group, groups
from phigen.analysis.drawing.leaf import Leaf, leaf_of, net
from phigen.analysis.drawing.palette import PALETTE, SERIES
from phigen.runtime.trajectory import Trajectory
from phigen.symbolic.expression import Expression

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

#: Up to so many coordinates are drawn panel by panel, more as an image over time.
MOST_COORDINATES = 24
#: Rows are not joined if the typical angle between their chords is more than this: the line would not be the orbit.
TURN = math.radians(40)
#: The view of a panel in space in degrees, and the bands of distance that fade towards the back.
ELEVATION, AZIMUTH, BANDS = 22.0, -52.0, 4


def grid(coordinates: tuple[str, ...]) -> tuple[int, int]:
    """Rows and columns of the panels of a trajectory."""
    panels = 1 if len(coordinates) > MOST_COORDINATES else len(groups(coordinates))
    columns = panels if panels < 4 else 2 if panels == 4 else 3
    return -(-panels // columns), columns


def height(coordinates: tuple[str, ...]) -> float:
    """The height of all panels in inches."""
    rows, columns = grid(coordinates)
    return rows * (4.4 if len(coordinates) == 3 else 3.4 if columns < 3 else 2.4)


def draw_trajectory(figure: FigureBase, trajectory: Trajectory, casimirs: Mapping[str, Expression]) -> None:
    """All panels of a trajectory; rows that are not finite are left out."""
    good = np.isfinite(trajectory.x).all(axis=1)
    t, x, names = trajectory.t[good], trajectory.x[good], trajectory.coordinates
    if len(names) > MOST_COORDINATES:
        _draw_image(figure, t, x)
        return
    rows, columns = grid(names)
    start = dict(zip(names, x[0].tolist(), strict=True))
    for index, group in enumerate(groups(names), start=1):
        points = x[:, [names.index(name) for name in group]]
        if len(group) == 3:
            axes = figure.add_subplot(rows, columns, index, projection="3d")
            draw_in_space(axes, group, points, leaf_of(casimirs, group, start, trajectory.parameters))
        elif len(group) == 2:
            draw_in_plane(figure.add_subplot(rows, columns, index), group, points)
        else:
            draw_in_plane(figure.add_subplot(rows, columns, index), ("t", *group), np.column_stack([t, points]))


def draw_in_plane(axes: Any, names: Group, points: Floats) -> None:
    """A curve (rows, 2), and where it starts."""
    _label(axes, names)
    axes.grid(True)
    _draw_curve(axes, points, SERIES[0], 1.0, 2.0)
    axes.plot(*points[0], "o", color=PALETTE["ink"], markersize=4, zorder=3)


def draw_in_space(axes: Any, names: Group, points: Floats, leaf: Leaf | None) -> None:
    """A curve (rows, 3) over the net of its leaf, paler towards the back, and where it starts."""
    box = _box(points)
    # The same unit of length along all axes, unless a coordinate would be squeezed flat.
    size = box[1] - box[0]
    axes.set_box_aspect(size if size.max() < 4 * size.min() else (1, 1, 1), zoom=1.0)
    axes.view_init(ELEVATION, AZIMUTH)
    axes.set(xlim=box[:, 0], ylim=box[:, 1], zlim=box[:, 2])
    _label(axes, names)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.pane.set_visible(False)
        axis._axinfo["grid"].update(color=PALETTE["grid"], linewidth=0.4)
        axis.set_major_locator(_few_ticks())
    axes.tick_params(pad=-1, labelsize=7)
    if leaf:
        lines = [part for line in net(leaf, box) for part in (line, np.full((1, 3), np.nan))]
        if lines:
            _draw_faded(axes, box, np.concatenate(lines), PALETTE["leaf"], 0.45, (0.2, 0.75), 1.0)
    _draw_faded(axes, box, points, SERIES[0], None, (0.3, 1.0), 1.5)
    axes.plot(*points[0], "o", color=PALETTE["ink"], markersize=4, zorder=20)


def _draw_faded(
    axes: Any, box: Floats, points: Floats, colour: str, width: float | None, alphas: tuple[float, float], order: float
) -> None:
    """Points (rows, 3) as a curve, in bands by their distance from the viewer."""
    e, a = math.radians(ELEVATION), math.radians(AZIMUTH)
    towards = np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])
    centred = (points - box.mean(axis=0)) / (box[1] - box[0])
    depth = np.clip(centred @ towards / np.abs(towards).sum() * 2 + 0.5, 0, 1 - 1e-9)
    band = np.where(np.isfinite(depth), np.floor(depth * BANDS), -1)
    joined = width is not None or _joins(points)
    for level in range(BANDS):
        # A band keeps the point after its last one, so that no gap opens between bands.
        inside = band == level
        shown = inside | np.r_[False, inside[:-1]] if joined else inside
        alpha = alphas[0] + (alphas[1] - alphas[0]) * level / (BANDS - 1)
        if inside.any():
            kept = np.where(shown[:, None], points, np.nan)
            _draw_curve(axes, kept, colour, alpha, order + 10 * (level >= BANDS / 2), width, joined)


def _draw_curve(
    axes: Any, points: Floats, colour: str, alpha: float, order: float, width: float | None = None,
    joined: bool | None = None,
) -> None:  # fmt: skip
    """A line, thinner the more rows it has, or dots where the rows are too far apart for one."""
    count = len(points)
    if joined if joined is not None else _joins(points):
        thin = width or float(np.clip(1.5 - 0.35 * math.log10(max(count, 1) / 100), 0.5, 1.5))
        axes.plot(*points.T, "-", color=colour, linewidth=thin, alpha=alpha, zorder=order)
    else:
        size = float(np.clip(3.0 - 0.8 * math.log10(max(count, 1) / 100), 0.8, 3.0))
        many = {"rasterized": True} if count > 10_000 else {}
        axes.plot(*points.T, ".", color=colour, markersize=size, markeredgewidth=0, alpha=alpha, zorder=order, **many)


def _joins(points: Floats) -> bool:
    """Whether chords between the rows look like the curve."""
    points = points[np.isfinite(points).all(axis=1)]
    size = np.ptp(points, axis=0) if len(points) else np.zeros(points.shape[1])
    chords = np.diff(points / np.where(size > 0, size, 1.0), axis=0)
    lengths = np.linalg.norm(chords, axis=1)
    moved = lengths > 1e-12
    chords, lengths = chords[moved], lengths[moved]
    if len(chords) < 3:
        return True
    cosines = np.sum(chords[1:] * chords[:-1], axis=1) / (lengths[1:] * lengths[:-1])
    return bool(np.median(np.arccos(np.clip(cosines, -1, 1))) < TURN)


def _draw_image(figure: FigureBase, t: Floats, x: Floats) -> None:
    """All coordinates over time, as colours."""
    axes = figure.add_subplot()
    most = float(np.max(np.abs(x))) or 1.0
    times = np.linspace(0, len(t) - 1, min(len(t), 800)).astype(int)
    shown = axes.imshow(
        x[times].T, aspect="auto", origin="lower", cmap="RdBu_r", vmin=-most, vmax=most, interpolation="nearest",
        extent=(t[0], t[-1], 0.5, x.shape[1] + 0.5),
    )  # fmt: skip
    axes.set(xlabel="t", ylabel="coordinate")
    figure.colorbar(shown, ax=axes, pad=0.02)


def _box(points: Floats) -> Floats:
    """Bounds (2, 3) around points, not too flat, with a margin."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = high - low
    half = np.maximum(0.55 * size, 0.2 * size.max() or 0.5)
    middle = (low + high) / 2
    return np.stack([middle - half, middle + half])


def _few_ticks() -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(4)


def _label(axes: Any, names: Group) -> None:
    for axis, name in zip("xyz", names, strict=False):
        getattr(axes, f"set_{axis}label")(name, labelpad=-4 if len(names) == 3 else 2)
