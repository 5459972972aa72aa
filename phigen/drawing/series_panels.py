"""Panels of quantities of lattices over time, such as energies and observables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from phigen.drawing.palette import SERIES
from phigen.symbolic.arrays import Floats

#: MAX_PANELS: largest number of observables with a panel in the figure of a run. HEIGHT: height of a panel in inches.
MAX_PANELS, HEIGHT = 4, 1.4


def draw_series(axes: Any, name: str, t: Floats, values: Floats) -> None:
    """Draw values (rows,) of an observable over the time."""
    axes.plot(t, values, color=SERIES[0], linewidth=1.0)
    axes.set(xlabel="t", ylabel=name)
    axes.grid(True)


def height(observables: Mapping[str, Floats]) -> float:
    """Return the height of the panels of `draw_observables` in inches."""
    return HEIGHT * min(len(observables), MAX_PANELS)


def draw_observables(part: Any, t: Floats, observables: Mapping[str, Floats]) -> None:
    """Draw the first `MAX_PANELS` observables over time, one panel each, in a figure or subfigure ``part``."""
    names = [*observables][:MAX_PANELS]
    panels = np.atleast_1d(part.subplots(len(names), 1, sharex=True))
    for axes, name in zip(panels, names, strict=True):
        draw_series(axes, name, t, observables[name])
        axes.label_outer()
