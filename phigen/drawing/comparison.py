"""Figure of a comparison of methods: errors of energy and orbit over CPU time, with a point for each method."""

from __future__ import annotations

from typing import TYPE_CHECKING

from phigen.drawing.palette import PALETTE, SERIES, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from phigen.tuning.comparison import Comparison

_MARKERS = "osD^vXP*"


@styled
def figure(comparison: Comparison, title: str) -> Figure:
    """Return a figure with energy errors on the left, and with orbit errors on the right if they are known.

    Methods whose steps are Poisson maps have filled points.
    """
    from matplotlib.figure import Figure

    entries = [entry for entry in comparison.entries if not entry.refusal]
    panels = [("energy error", [entry.error for entry in entries])]
    if any(entry.orbit for entry in entries):
        panels.append(("orbit error", [entry.orbit or float("nan") for entry in entries]))
    canvas = Figure(figsize=(4.6 * len(panels) + 2.2, 3.8), layout="constrained")
    for axes, (label, errors) in zip(canvas.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        for index, (entry, error) in enumerate(zip(entries, errors, strict=True)):
            colour = SERIES[index % len(SERIES)] if entry.poisson else PALETTE["ink"]
            axes.plot(
                1e3 * entry.seconds, error, _MARKERS[index % len(_MARKERS)], color=colour,
                markerfacecolor=colour if entry.poisson else "none", label=entry.title,
            )  # fmt: skip
        axes.set(xscale="log", yscale="log", xlabel="CPU time of the run, ms", ylabel=label)
        axes.grid(True)
    canvas.suptitle(title)
    canvas.legend(*axes.get_legend_handles_labels(), loc="outside right upper", fontsize="small")
    return canvas
