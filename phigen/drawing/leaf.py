"""Symplectic leaf in a three-dimensional plot: the surface on which a Casimir is constant.

The surface is drawn as a net of curves. Each curve is the intersection of the surface with a plane.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from phigen.symbolic.arrays import Floats, evaluate
from phigen.symbolic.expression import Expression, gradient, symbols_of

#: CUTS: number of planes perpendicular to each axis. GRID: number of grid points along a side of a plane. NEWTON_STEPS:
#: number of Newton steps that move the points of a line onto the surface.
CUTS, GRID, NEWTON_STEPS = 9, 41, 8


@dataclass(frozen=True)
class Leaf:
    """Surface on which the function ``casimir`` of three coordinates has the value ``level``.

    ``names`` are the names of the coordinates; ``parameters`` has the values of all other symbols.
    """

    casimir: Expression
    names: tuple[str, ...]
    parameters: Mapping[str, float]
    level: float

    def value_and_gradient(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the values of ``casimir`` − ``level`` (…) and of its gradient (…, 3) at points (…, 3)."""
        values = {**self.parameters, **{name: points[..., i] for i, name in enumerate(self.names)}}
        arrays = evaluate([self.casimir, *gradient(self.casimir, self.names)], values)
        value, *slopes = (np.broadcast_to(a, points.shape[:-1]) for a in arrays)
        return value - self.level, np.stack(slopes, axis=-1)


def leaf_of(
    casimirs: Mapping[str, Expression],
    names: Sequence[str],
    start: Mapping[str, float],
    parameters: Mapping[str, float],
) -> Leaf | None:
    """Return the leaf through the point ``start``; None if there is no leaf, or if ``names`` are not three coordinates.

    The leaf is that of the first Casimir that depends on no coordinates except ``names``.
    """
    for casimir in casimirs.values():
        used_names = set(symbols_of(casimir)) & set(start)
        if len(names) == 3 and used_names and used_names <= set(names):
            level = float(evaluate([casimir], {**parameters, **start})[0])
            return Leaf(casimir, tuple(names), parameters, level) if np.isfinite(level) else None
    return None


def around(leaf: Leaf, box: Floats) -> Floats:
    """Return a box (2, 3) of lower and upper bounds that contains ``box`` and the whole leaf.

    The box is returned unchanged if the leaf is not a closed surface, or if the leaf is much larger than the box.
    """
    middle, half_width = box.mean(axis=0), float(np.max(box[1] - box[0]))
    large_box = np.stack([middle - half_width, middle + half_width])
    lines = net(leaf, large_box)
    if not lines:
        return box
    points = np.concatenate(lines)
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.04 * (high - low)
    is_closed = (low > large_box[0] + margin).all() and (high < large_box[1] - margin).all()
    return np.stack([np.minimum(box[0], low - margin), np.maximum(box[1], high + margin)]) if is_closed else box


def net(leaf: Leaf, box: Floats) -> list[Floats]:
    """Return lines (points, 3) of the leaf within a box (2, 3) of lower and upper bounds."""
    lines = []
    cell = (box[1] - box[0]) / (GRID - 1)
    for axis in range(3):
        for level in np.linspace(box[0, axis], box[1, axis], CUTS + 2)[1:-1]:
            for line in _lines_in_plane(leaf, box, axis, float(level)):
                lines += _on_surface(leaf, line, axis, cell)
    return lines


def _lines_in_plane(leaf: Leaf, box: Floats, axis: int, level: float) -> list[Floats]:
    """Return the lines in which the leaf meets the plane x_axis = ``level``. They are found by linear interpolation on
    a grid.
    """
    from contourpy import contour_generator

    u, v = (np.linspace(box[0, i], box[1, i], GRID) for i in range(3) if i != axis)
    grid = np.insert(np.stack(np.meshgrid(u, v), axis=-1), axis, level, axis=-1)
    values, _ = leaf.value_and_gradient(grid)
    # Where the Casimir is undefined, the grid is masked, and no lines are drawn.
    lines = contour_generator(u, v, np.ma.masked_invalid(values)).lines(0.0)
    return [np.insert(np.asarray(line, dtype=np.float64), axis, level, axis=-1) for line in lines]


def _on_surface(leaf: Leaf, line: Floats, axis: int, cell: Floats) -> list[Floats]:
    """Return the line (points, 3), moved onto the leaf by Newton steps.

    The line lies in a plane perpendicular to ``axis``, and its points stay in this plane. Points at which Newton's
    method fails, for instance at a pole of the Casimir, are left out. The line is cut there, so the result may be
    several lines.
    """
    points = line.copy()
    with np.errstate(all="ignore"):
        for _ in range(NEWTON_STEPS):
            value, slope = leaf.value_and_gradient(points)
            slope[:, axis] = 0.0
            change = (value / np.sum(slope**2, axis=-1))[:, None] * slope
            points = points - change
        converged = (np.abs(change) < 1e-3 * cell).all(axis=-1) & (np.abs(points - line) < cell).all(axis=-1)
    segments = np.split(points, np.flatnonzero(converged[1:] != converged[:-1]) + 1)
    starts = np.r_[True, converged[1:] != converged[:-1]]
    return [
        segment for segment, is_good in zip(segments, converged[starts], strict=True) if is_good and len(segment) > 1
    ]
