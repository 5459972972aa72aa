"""Colour maps. For values of both signs the map diverges around 0; otherwise it extends from the least to the largest
value.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from phigen.symbolic.arrays import Floats

#: Colour maps for values of both signs, and for other values.
DIVERGING, SEQUENTIAL = "RdBu_r", "viridis"


def bounds_of(values: Floats) -> tuple[float, float]:
    """Return the lower and upper end of a colour scale for values.

    If values have both signs, the ends are symmetric about 0.
    """
    least, largest = float(np.min(values)), float(np.max(values))
    if least < 0 < largest:
        return -max(-least, largest), max(-least, largest)
    margin = 0.0 if least < largest else abs(least) / 2 or 0.5
    return least - margin, largest + margin


def shades_of(values: Floats, levels: int = 256) -> dict[str, Any]:
    """Return a colour map with ``levels`` colours, and the ends of its scale, as keyword arguments of matplotlib."""
    from matplotlib import colormaps

    low, high = bounds_of(values)
    colours = colormaps[DIVERGING if low < 0 < high else SEQUENTIAL].resampled(levels)
    return {"cmap": colours, "vmin": low, "vmax": high}
