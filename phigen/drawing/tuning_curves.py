"""Plot of the error against the computing time, for all settings that a tuning has tried."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from phigen.drawing.error_curves import LINES
from phigen.drawing.palette import MARK, PALETTE, SERIES

if TYPE_CHECKING:
    from phigen.tuning.search import Curve
    from phigen.tuning.study import Tuning

#: Largest relative error that is drawn; at larger errors the solution is useless.
_LARGEST_ERROR = 1.0
_MARKERS = "osD^vX"


def draw_tuning(axes: Any, tuning: Tuning) -> None:
    """Draw a curve for each setting: the best settings in colour, classical methods dark, the others pale.

    A star marks a proposed step. Steps are proposed for the best settings and for classical methods.
    """
    coloured = [f.curve for f in (*tuning.finalists, *tuning.peers)]
    pale = [c for c in tuning.curves if c not in coloured and c.points]
    for curve in pale:
        axes.plot(*_coordinates(curve, tuning.horizon), color=PALETTE["grid"], linewidth=0.8, zorder=1)
    finalist_count = len(tuning.finalists)
    for index, finalist in enumerate((*tuning.finalists, *tuning.peers)):
        colour = SERIES[index % len(SERIES)] if index < finalist_count else PALETTE["ink"]
        axes.plot(
            *_coordinates(finalist.curve, tuning.horizon), color=colour, linestyle=LINES[index % len(LINES)],
            linewidth=1.0, marker=_MARKERS[index % len(_MARKERS)], markersize=3, markeredgewidth=0,
            zorder=3 - 0.1 * index, label=finalist.curve.title,
        )  # fmt: skip
        axes.plot(
            1e3 * finalist.cost * tuning.horizon, finalist.point.error, "*", color=colour, markersize=11,
            markeredgewidth=0, zorder=4,
        )  # fmt: skip
    if pale:
        axes.plot([], [], color=PALETTE["grid"], linewidth=0.8, label="other candidates")
    axes.axhline(tuning.accuracy, **MARK)
    error_name = "energy error" if tuning.measure == "energy" else "error of the orbit"
    axes.set(
        xscale="log", yscale="log", xlabel="CPU time of the run, ms",
        ylabel=f"{error_name} up to {tuning.clock} = {tuning.horizon:.4g}", title=_basis(tuning),
    )  # fmt: skip
    axes.grid(True)
    axes.minorticks_off()
    axes.legend(loc="best")


def _coordinates(curve: Curve, horizon: float) -> tuple[list[float], list[float]]:
    points = [p for p in curve.points if p.error < _LARGEST_ERROR]
    return [1e-6 * p.cost * horizon for p in points], [p.error for p in points]


def _basis(tuning: Tuning) -> str:
    """Return a sentence on the part of the run over which the errors were measured."""
    if tuning.piece > 0.99 * tuning.horizon:
        return "measured over this whole time"
    best = tuning.winner
    farther = best is not None and best.point.time > 1.01 * tuning.piece
    star_note = f"; stars: measured to {tuning.clock} = {best.point.time:.4g}" if best and farther else ""
    return f"measured to {tuning.clock} = {tuning.piece:.4g} and extrapolated{star_note}"
