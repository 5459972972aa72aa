"""Pictures of dynamic structure factors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from phigen.drawing.palette import styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from phigen.study.spectra import DynamicSpectrum

#: Decades below the largest value that are shown: what lies below is leakage of the window, and rounding.
DECADES = 6


@styled
def spectrum_figure(spectrum: DynamicSpectrum, title: str) -> Figure:
    """S(q, ω) by its logarithm over q of the first axis and ω ≥ 0, at q = 0 of the others."""
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    values = spectrum.values
    while values.ndim > 2:
        values = values[:, values.shape[1] // 2]
    upper = spectrum.omega >= 0
    shown, most = values[:, upper].T, float(values.max()) or 1.0
    figure = Figure(figsize=(5.6, 4.0), layout="constrained")
    axes = figure.subplots()
    least = most * 10.0**-DECADES
    floor, norm = np.maximum(shown, least), LogNorm(least, most)
    image = axes.pcolormesh(spectrum.q[0], spectrum.omega[upper], floor, norm=norm, rasterized=True)
    axes.set(xlabel=f"q along {spectrum.axes[0]}", ylabel="ω", title=title)
    figure.colorbar(image, ax=axes, label=f"S(q, ω) of {', '.join(spectrum.of)}")
    return figure
