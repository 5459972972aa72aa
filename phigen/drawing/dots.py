"""Many dots drawn as one path, which takes a tenth of the bytes of markers in an SVG file."""

from __future__ import annotations

from typing import Any

import numpy as np

from phigen.symbolic.arrays import Floats


def draw_dots(axes: Any, points: Floats, colour: str, size: float, order: float, label: str | None = None) -> None:
    """Draw dots at points (rows, 2) as very short lines with round ends; ``size`` is the diameter in 1/72 inch."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    # Some programs do not draw lines of length 0, so each dot is a line of a small length.
    offset = 1e-5 * np.max(np.abs(points), axis=0, initial=1e-300)
    vertices = np.stack([points, points + offset], axis=1).reshape(-1, 2)
    path = Path(vertices, np.tile([Path.MOVETO, Path.LINETO], len(points)).astype(np.uint8))
    path.should_simplify = False
    patch = PathPatch(path, facecolor="none", edgecolor=colour, linewidth=size, capstyle="round", zorder=order)
    axes.add_patch(patch)
    axes.plot([], [], ".", color=colour, label=label)
    axes.update_datalim(points)
    axes.autoscale_view()
