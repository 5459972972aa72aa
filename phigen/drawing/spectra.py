"""Plots of correlations, and of dynamic structure factors S(q, ω) with wave vector q and frequency ω."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from phigen.drawing.palette import styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from phigen.runtime.spectra import Correlation, DynamicSpectrum

#: Number of decades that are shown below the largest value. Smaller values are not meaningful: they come from rounding,
#: or from the window function, which spreads large values over other frequencies.
DECADES = 6


@styled
def spectrum_figure(spectrum: DynamicSpectrum, title: str) -> Figure:
    """Return a figure of log S(q, ω) over ω ≥ 0 and over q along the first axis of the lattice.

    The other components of the wave vector q are 0.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.6, 4.0), layout="constrained")
    draw_spectrum(figure, spectrum, title)
    return figure


def draw_correlation(axes: Any, correlation: Correlation) -> None:
    """Draw the correlation of two fields against the distance between the sites."""
    axes.plot(np.arange(len(correlation.values)), correlation.values, ".-", linewidth=1.0)
    axes.axhline(0.0, color="0.6", linewidth=0.8)
    axes.set(
        xlabel=f"distance along {correlation.axis}", ylabel=f"correlation of {', '.join(dict.fromkeys(correlation.of))}"
    )
    axes.grid(True)


def draw_spectrum(figure: Any, spectrum: DynamicSpectrum, title: str = "") -> None:
    """Draw log S(q, ω) in a figure or subfigure, over ω ≥ 0 and over q along the first axis of the lattice."""
    from matplotlib.colors import LogNorm

    values = spectrum.values
    while values.ndim > 2:
        values = values[:, values.shape[1] // 2]
    upper = spectrum.omega >= 0
    image_values, largest = values[:, upper].T, float(values.max()) or 1.0
    axes = figure.subplots()
    least = largest * 10.0**-DECADES
    floor, norm = np.maximum(image_values, least), LogNorm(least, largest)
    image = axes.pcolormesh(spectrum.q[0], spectrum.omega[upper], floor, norm=norm, rasterized=True)
    axes.set(xlabel=f"q along {spectrum.axes[0]}", ylabel="ω", title=title)
    figure.colorbar(image, ax=axes, label=f"S(q, ω) of {', '.join(spectrum.of)}")
