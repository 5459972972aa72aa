"""Plots of Poincaré sections: crossings of a trajectory through a surface."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from phigen.drawing.dots import draw_dots
from phigen.drawing.groups import phase_planes
from phigen.drawing.palette import SERIES
from phigen.symbolic.arrays import Floats

#: A coordinate counts as constant on the section if it varies by less than this fraction of the largest variation.
_CONSTANT = 1e-8


def plane_of(names: Sequence[str], points: Floats) -> tuple[int, int]:
    """Return the indices of the two columns of ``points`` (rows, names) to draw.

    The columns belong to the first of the `phase_planes` in which two coordinates vary, such as a position and its
    momentum. If there is no such plane, any varying columns are drawn. Constant columns are drawn only if fewer than
    two columns vary.
    """
    span = np.ptp(points, axis=0) if len(points) else np.ones(len(names))
    constant = span <= _CONSTANT * max(float(span.max()), float(np.max(np.abs(points), initial=0.0)) * 1e-4)
    varying = [name for name, is_constant in zip(names, constant, strict=True) if not is_constant]
    pairs = [moving for group in phase_planes(names) if len(moving := [n for n in group if n in varying]) >= 2]
    # A closed orbit may always cross the surface at the same point. Then all coordinates are constant. The surface
    # probably fixes a coordinate to 0, so the coordinates with the largest values are drawn.
    sizes = np.max(np.abs(points), axis=0, initial=0.0)
    by_size = sorted((n for n in names if n not in varying), key=lambda n: -sizes[list(names).index(n)])
    columns = (pairs[0] if pairs else [*varying, *by_size])[:2]
    first, second = sorted(map(list(names).index, columns))
    return first, second


def draw_section(axes: Any, sections: Mapping[str, Floats], names: Sequence[str]) -> None:
    """Draw the points (rows, names) of each section as dots."""
    point_sets = [points for points in sections.values() if len(points)]
    i, j = plane_of(names, np.concatenate(point_sets) if point_sets else np.empty((0, len(names))))
    for index, (label, points) in enumerate(sections.items()):
        size = float(np.clip(4.0 - 1.1 * math.log10(max(len(points), 1) / 30), 0.8, 4.0))
        draw_dots(axes, points[:, [i, j]], SERIES[index % len(SERIES)], size, 2.0, label)
    axes.set(xlabel=names[i], ylabel=names[j])
    axes.grid(True)
    axes.locator_params(axis="x", nbins=6)
    axes.set_box_aspect(0.75)
    _widen(axes)
    if len(sections) > 1:
        axes.legend(loc="best")
    else:
        label, points = next(iter(sections.items()))
        axes.set_title(f"section {label}: {len(points)} crossings")


def _widen(axes: Any) -> None:
    """Widen the axes if all points agree up to rounding. Otherwise rounding errors would fill the panel."""
    for kind in "xy":
        low, high = getattr(axes, f"get_{kind}lim")()
        middle, half_width = (low + high) / 2, (high - low) / 2
        least = 0.05 * max(abs(middle), 1e-9)
        if half_width < 1e-2 * least:
            getattr(axes, f"set_{kind}lim")(middle - least, middle + least)
