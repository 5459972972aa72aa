"""Drawing of many dots as one path. In an SVG file, markers would take ten times as many bytes."""

from __future__ import annotations

from typing import Any

import numpy as np

from phigen.symbolic.arrays import Floats


def draw_dots(axes: Any, points: Floats, colour: str, size: float, order: float, label: str | None = None) -> None:
    """Draw dots at points (rows, 2) as very short lines with round ends; ``size`` is the diameter in 1/72 inch."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    # Some programs do not draw lines of length 0, so each dot is a line that is a little longer.
    offset = 1e-5 * np.max(np.abs(points), axis=0, initial=1e-300)
    vertices = np.stack([points, points + offset], axis=1).reshape(-1, 2)
    path = Path(vertices, np.tile([Path.MOVETO, Path.LINETO], len(points)).astype(np.uint8))
    path.should_simplify = False
    patch = PathPatch(path, facecolor="none", edgecolor=colour, linewidth=size, capstyle="round", zorder=order)
    axes.add_patch(patch)
    axes.plot([], [], ".", color=colour, label=label)
    axes.update_datalim(points)
    axes.autoscale_view()
