"""Drawings of trajectories in phase space: plots of two coordinates, three-dimensional plots with the leaf of a
Casimir, or plots of coordinates against time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from phigen.drawing.dots import draw_dots
from phigen.drawing.groups import Group, groups, is_orbit
from phigen.drawing.leaf import Leaf, around, leaf_of, net
from phigen.drawing.lettering import letter
from phigen.drawing.palette import PALETTE, SERIES
from phigen.drawing.shades import shades_of
from phigen.runtime.trajectory import Trajectory
from phigen.symbolic.arrays import Floats
from phigen.symbolic.expression import Expression

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

#: Largest number of coordinates with separate panels; more coordinates are drawn as one image against time.
MOST_COORDINATES = 24
#: Points are drawn as dots if the typical angle between successive chords exceeds TURN, since a line would not show the
#: orbit. For long curves the limit is FINE_TURN, since the chords of a long curve would cover the panel.
TURN, FINE_TURN = math.radians(40), math.radians(15)
#: A curve is long if its length is at least this multiple of the size of its panel.
LONG = 60.0
#: ELEVATION: elevation of the view in three-dimensional plots. AZIMUTHS: azimuths to choose from; the first is the
#: default. Angles are in degrees. BANDS: a curve is drawn in this number of parts by distance from the viewer; the
#: farther parts are paler.
ELEVATION, AZIMUTHS, BANDS = 22.0, (-52.0, -22.0, 8.0, 38.0, -82.0, -112.0), 4

#: Zoom of the box of a three-dimensional plot in a small panel. The zoom in large panels is larger.
SMALL = 0.76


def grid(coordinates: tuple[str, ...]) -> tuple[int, int]:
    """Return the numbers of rows and columns of the panels of a trajectory."""
    panels = 1 if len(coordinates) > MOST_COORDINATES else len(groups(coordinates))
    columns = panels if panels < 4 else 2 if panels == 4 else 3
    return -(-panels // columns), columns


def height(coordinates: tuple[str, ...]) -> float:
    """Return the height of all panels together, in inches."""
    rows, columns = grid(coordinates)
    return rows * (4.4 if len(coordinates) == 3 else 3.4 if columns < 3 else 2.4)


def draw_trajectory(figure: FigureBase, trajectory: Trajectory, casimirs: Mapping[str, Expression]) -> None:
    """Draw all panels of a trajectory; rows that are not finite are left out."""
    finite = np.isfinite(trajectory.x).all(axis=1)
    t, x, names = trajectory.t[finite], trajectory.x[finite], trajectory.coordinates
    if len(names) > MOST_COORDINATES:
        _draw_image(figure, names, t, x)
        return
    rows, columns = grid(names)
    zoom = 0.9 if columns < 3 else SMALL  # the labels around the box need more room in small panels
    start = dict(zip(names, x[0].tolist(), strict=True))
    for index, group in enumerate(groups(names), start=1):
        points = x[:, [names.index(name) for name in group]]
        if len(group) == 3:
            axes = figure.add_subplot(rows, columns, index, projection="3d")
            draw_in_space(axes, group, points, leaf_of(casimirs, group, start, trajectory.parameters), zoom)
        elif len(group) == 2:
            axes = figure.add_subplot(rows, columns, index)
            draw_in_plane(axes, group, points)
            if is_orbit(names):
                axes.set_aspect("equal", adjustable="datalim")
        else:
            draw_in_plane(figure.add_subplot(rows, columns, index), ("t", *group), np.column_stack([t, points]))


def draw_in_plane(axes: Any, names: Group, points: Floats) -> None:
    """Draw a curve (rows, 2) with a dot at its first point."""
    axes.set_xlabel(names[0], labelpad=2)
    axes.set_ylabel(names[1], labelpad=2)
    axes.grid(True)
    _draw_curve(axes, points, SERIES[0], 1.0, 2.0, _width(points), joins(points))
    axes.plot(*points[0], "o", color=PALETTE["ink"], markersize=4, zorder=3)
    axes.locator_params(axis="x", nbins=5)


def draw_in_space(axes: Any, names: Group, points: Floats, leaf: Leaf | None, zoom: float) -> None:
    """Draw a curve (rows, 3) with a dot at its first point, and the net of its leaf.

    The net is paler towards the back. The curve is paler towards the back too, unless it is long.
    """
    box = around(leaf, box_of(points)) if leaf else box_of(points)
    # All axes have the same scale, unless a coordinate would become too flat.
    size = box[1] - box[0]
    axes.set_box_aspect(size if size.max() < 2.2 * size.min() else (1, 1, 1), zoom=zoom)
    azimuth = _azimuth((points - points.mean(axis=0)) / size)
    axes.view_init(ELEVATION, azimuth)
    axes.set(xlim=box[:, 0], ylim=box[:, 1], zlim=box[:, 2])
    letter(axes, names, box, 4 if zoom > SMALL else 3)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.pane.set_visible(False)
        axis._axinfo["grid"].update(color=PALETTE["grid"], linewidth=0.4)
    towards = _directions(azimuth)[2]
    if leaf:
        lines = [part for line in net(leaf, box) for part in (line, np.full((1, 3), np.nan))]
        if lines:
            _draw_faded(axes, box, towards, np.concatenate(lines), PALETTE["leaf"], 0.45, (0.2, 0.75), 1.0)
    # A long curve has one shade. With several shades, the points at which the shade changes would be visible.
    alphas = (0.3, 1.0) if _length(points) < LONG else (0.8, 0.8)
    _draw_faded(axes, box, towards, points, SERIES[0], _width(points), alphas, 1.5, joins(points))
    axes.plot(*points[0], "o", color=PALETTE["ink"], markersize=4, zorder=20)


def _directions(azimuth: float) -> Floats:
    """Return the unit vectors to the right, upwards, and towards the viewer, as rows (3, 3)."""
    e, a = math.radians(ELEVATION), math.radians(azimuth)
    towards = np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])
    right = np.array([-math.sin(a), math.cos(a), 0.0])
    return np.stack([right, np.cross(towards, right), towards])


def _azimuth(centred: Floats) -> float:
    """Return the azimuth of a view in which the curve is not seen edge-on.

    The default azimuth is returned, unless the curve has a much larger area in another view.
    """
    spread = centred.T @ centred

    def area(azimuth: float) -> float:
        plane = _directions(azimuth)[:2]
        return float(np.linalg.det(plane @ spread @ plane.T))

    best = max(AZIMUTHS, key=area)
    return best if area(best) > 3 * area(AZIMUTHS[0]) else AZIMUTHS[0]


def _draw_faded(
    axes: Any, box: Floats, towards: Floats, points: Floats, colour: str, width: float,
    alphas: tuple[float, float], order: float, as_curve: bool = True,
) -> None:  # fmt: skip
    """Draw points (rows, 3) as a curve, or as dots if ``as_curve`` is False.

    The distances from the viewer are divided into `BANDS` bands. The points of a band have one shade.
    """
    centred = (points - box.mean(axis=0)) / (box[1] - box[0])
    depth = np.clip(centred @ towards / np.abs(towards).sum() * 2 + 0.5, 0, 1 - 1e-9)
    band = np.where(np.isfinite(depth), np.floor(depth * BANDS), -1)
    for level in range(BANDS):
        # The curve in a band is drawn up to the next point, which lies in another band. Otherwise there would be gaps
        # between bands.
        in_band = band == level
        band_rows = in_band | np.r_[False, in_band[:-1]] if as_curve else in_band
        alpha = alphas[0] + (alphas[1] - alphas[0]) * level / (BANDS - 1)
        if in_band.any():
            visible = np.where(band_rows[:, None], points, np.nan)
            _draw_curve(axes, visible, colour, alpha, order + 10 * (level >= BANDS / 2), width, as_curve)


def _draw_curve(
    axes: Any, points: Floats, colour: str, alpha: float, order: float, width: float, as_curve: bool
) -> None:
    """Draw points as a line, or as dots if ``as_curve`` is False."""
    if as_curve:
        axes.plot(*points.T, "-", color=colour, linewidth=width, alpha=alpha, zorder=order)
        return
    size = float(np.clip(3.0 - 0.8 * math.log10(max(len(points), 1) / 100), 0.8, 3.0))
    if points.shape[1] == 2:
        draw_dots(axes, points, colour, size, order)
    else:
        axes.plot(*points.T, ".", color=colour, markersize=size, markeredgewidth=0, alpha=alpha, zorder=order)


def _width(points: Floats) -> float:
    """Return the line width of a curve, in units of 1/72 inch. Longer curves have thinner lines."""
    return float(np.clip(1.5 * math.sqrt(LONG / 2 / max(_length(points), 1e-9)), 0.3, 1.5))


def joins(points: Floats) -> bool:
    """Return whether the chords between successive points (rows, n) show the shape of the curve."""
    points = points[np.isfinite(points).all(axis=1)]
    size = np.ptp(points, axis=0) if len(points) else np.zeros(points.shape[1])
    chords = np.diff(points / np.where(size > 0, size, 1.0), axis=0)
    lengths = np.linalg.norm(chords, axis=1)
    is_long = lengths > 1e-12
    chords, lengths = chords[is_long], lengths[is_long]
    if len(chords) < 3:
        return True
    cosines = np.sum(chords[1:] * chords[:-1], axis=1) / (lengths[1:] * lengths[:-1])
    median_turn = float(np.median(np.arccos(np.clip(cosines, -1, 1))))
    return median_turn < (TURN if np.sum(lengths) < LONG else FINE_TURN)


def _draw_image(figure: FigureBase, names: Group, t: Floats, x: Floats) -> None:
    """Draw all coordinates against time, as colours."""
    axes = figure.add_subplot()
    times = np.linspace(0, len(t) - 1, min(len(t), 800)).astype(int)
    image = axes.imshow(
        x[times].T, aspect="auto", origin="lower", interpolation="nearest",
        extent=(t[0], t[-1], 0.5, x.shape[1] + 0.5), **shades_of(x),
    )  # fmt: skip
    labelled_rows = range(0, len(names), -(-len(names) // 10))
    axes.set_yticks([1.0 + i for i in labelled_rows], [names[i] for i in labelled_rows])
    axes.set_xlabel("t")
    figure.colorbar(image, ax=axes, pad=0.02)


def box_of(points: Floats) -> Floats:
    """Return lower and upper bounds (2, 3) around points (rows, 3), with a margin.

    Along each axis, the width of the box is at least 0.4 times the largest extent of the points. If all values on an
    axis are below 1/100 of the largest value on any axis, the width along this axis is instead at least 1/10 of the
    largest value on this axis.
    """
    low, high, largest = points.min(axis=0), points.max(axis=0), np.max(np.abs(points), axis=0)
    size = high - low
    comparable = largest > 0.01 * largest.max()
    half_sizes = np.maximum(0.53 * size, np.where(comparable, 0.2 * size.max(), 0.05 * largest))
    half_sizes[half_sizes == 0] = 0.2 * size.max() or 0.5
    middle = (low + high) / 2
    return np.stack([middle - half_sizes, middle + half_sizes])


def _length(points: Floats) -> float:
    """Return the arc length of a curve. Its coordinates are first scaled, so that the range of each coordinate is 1."""
    size = np.ptp(points, axis=0)
    return float(np.sum(np.linalg.norm(np.diff(points / np.where(size > 0, size, 1.0), axis=0), axis=1)))
