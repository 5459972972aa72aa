"""Panels with time series of lattices, such as energies and observables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from phigen.drawing.palette import SERIES
from phigen.symbolic.arrays import Floats

#: Largest number of observables in a figure of a run, and the height of each panel.
MAX_PANELS, HEIGHT = 4, 1.4


def draw_series(axes: Any, name: str, t: Floats, values: Floats) -> None:
    """Draw an observable against the time."""
    axes.plot(t, values, color=SERIES[0], linewidth=1.0)
    axes.set(xlabel="t", ylabel=name)
    axes.grid(True)


def height(observables: Mapping[str, Floats]) -> float:
    """Return the height of the panels of `draw_observables`."""
    return HEIGHT * min(len(observables), MAX_PANELS)


def draw_observables(part: Any, t: Floats, observables: Mapping[str, Floats]) -> None:
    """Draw the first observables against the time, one panel each, in a figure or a part of one."""
    names = [*observables][:MAX_PANELS]
    panels = np.atleast_1d(part.subplots(len(names), 1, sharex=True))
    for axes, name in zip(panels, names, strict=True):
        draw_series(axes, name, t, observables[name])
        axes.label_outer()
