"""Colour maps of values: diverging around 0 where the values have both signs, else from the least to the largest."""

from __future__ import annotations

from typing import Any

import numpy as np

from phigen.symbolic.arrays import Floats

#: Colour maps for values with both signs and for other values; the latter has no special colour for 0.
DIVERGING, SEQUENTIAL = "RdBu_r", "viridis"


def bounds_of(values: Floats) -> tuple[float, float]:
    """Return the ends of a scale of values, symmetric about 0 if the values have both signs."""
    least, largest = float(np.min(values)), float(np.max(values))
    if least < 0 < largest:
        return -max(-least, largest), max(-least, largest)
    margin = 0.0 if least < largest else abs(least) / 2 or 0.5
    return least - margin, largest + margin


def shades_of(values: Floats, levels: int = 256) -> dict[str, Any]:
    """Return a colour map with the given number of colours, and its bounds, as keyword arguments of matplotlib."""
    from matplotlib import colormaps

    low, high = bounds_of(values)
    colours = colormaps[DIVERGING if low < 0 < high else SEQUENTIAL].resampled(levels)
    return {"cmap": colours, "vmin": low, "vmax": high}
