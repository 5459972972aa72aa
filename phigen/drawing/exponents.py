"""Plot of the convergence of Lyapunov exponents."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from phigen.drawing.palette import MARK, PALETTE, SERIES

if TYPE_CHECKING:
    from phigen.study.lyapunov import Spectrum

#: Height of the panel in inches.
HEIGHT = 2.4


def draw_exponents(axes: Any, spectrum: Spectrum) -> None:
    """Draw all Lyapunov exponents over the averaging time; the largest is drawn on top."""
    axes.axhline(0, **MARK)
    for values in spectrum.history.T[:0:-1]:
        axes.plot(spectrum.times, values, color=PALETTE["leaf"], linewidth=0.9, zorder=2)
    axes.plot(spectrum.times, spectrum.history[:, 0], color=SERIES[0], linewidth=1.4, zorder=3)
    # Values in the first hundredth of the time do not determine the scale. They are large transients, and would
    # compress the curves of all later values.
    late_values = np.abs(spectrum.history[spectrum.times >= spectrum.t / 100])
    height = 1.2 * float(np.max(late_values)) or 1.0
    axes.set(xlim=(spectrum.t / 1000, 1.1 * spectrum.t), ylim=(-height, height))
    axes.set(xscale="log", xlabel=spectrum.clock, title=f"Lyapunov exponents; the largest is {spectrum.largest:.3g}")
    axes.grid(True)
