"""Values as colours: on both sides of 0 where their sign changes, else from the least to the largest."""

from __future__ import annotations

from typing import Any

import numpy as np

from phigen.symbolic.arrays import Floats

#: The maps of colours of values with both signs, and of others; the latter has no colour of its own for 0.
DIVERGING, SEQUENTIAL = "RdBu_r", "viridis"


def bounds_of(values: Floats) -> tuple[float, float]:
    """The ends of a scale of values, which is symmetric about 0 if some are negative and some positive."""
    least, most = float(np.min(values)), float(np.max(values))
    if least < 0 < most:
        return -max(-least, most), max(-least, most)
    around = 0.0 if least < most else abs(least) / 2 or 0.5
    return least - around, most + around


def shades_of(values: Floats, levels: int = 256) -> dict[str, Any]:
    """A map of so many colours and its bounds, as functions of matplotlib take them."""
    from matplotlib import colormaps

    low, high = bounds_of(values)
    colours = colormaps[DIVERGING if low < 0 < high else SEQUENTIAL].resampled(levels)
    return {"cmap": colours, "vmin": low, "vmax": high}
