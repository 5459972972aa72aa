"""Error against the time that a method takes, of all candidates of one tuning."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from phigen.drawing.error_curves import LINES
from phigen.drawing.palette import MARK, PALETTE, SERIES

if TYPE_CHECKING:
    from phigen.tuning.search import Curve
    from phigen.tuning.study import Tuning

#: Larger errors are not drawn.
_MOST = 1.0
_MARKERS = "osD^vX"


def draw_tuning(axes: Any, found: Tuning) -> None:
    """The finalists and the classical methods in colour, the other candidates pale; stars are confirmed proposals."""
    chosen = [f.curve for f in (*found.finalists, *found.peers)]
    others = [c for c in found.curves if c not in chosen and c.points]
    for curve in others:
        axes.plot(*_coordinates(curve, found.horizon), color=PALETTE["grid"], linewidth=0.8, zorder=1)
    own = len(found.finalists)
    for place, finalist in enumerate((*found.finalists, *found.peers)):
        colour = SERIES[place % len(SERIES)] if place < own else PALETTE["ink"]
        axes.plot(
            *_coordinates(finalist.curve, found.horizon), color=colour, linestyle=LINES[place % len(LINES)],
            linewidth=1.0, marker=_MARKERS[place % len(_MARKERS)], markersize=3, markeredgewidth=0,
            zorder=3 - 0.1 * place, label=finalist.curve.title,
        )  # fmt: skip
        axes.plot(
            1e3 * finalist.cost * found.horizon, finalist.point.error, "*", color=colour, markersize=11,
            markeredgewidth=0, zorder=4,
        )  # fmt: skip
    if others:
        axes.plot([], [], color=PALETTE["grid"], linewidth=0.8, label="other candidates")
    axes.axhline(found.accuracy, **MARK)
    what = "energy error" if found.measure == "energy" else "error of the orbit"
    axes.set(
        xscale="log", yscale="log", xlabel="CPU time of the run, ms",
        ylabel=f"{what} up to {found.clock} = {found.horizon:.4g}", title=_basis(found),
    )  # fmt: skip
    axes.grid(True)
    axes.minorticks_off()
    axes.legend(loc="best")


def _coordinates(curve: Curve, horizon: float) -> tuple[list[float], list[float]]:
    shown = [p for p in curve.points if p.error < _MOST]
    return [1e-6 * p.cost * horizon for p in shown], [p.error for p in shown]


def _basis(found: Tuning) -> str:
    """What of the picture was measured."""
    if found.piece > 0.99 * found.horizon:
        return "measured over all of it"
    best = found.winner
    farther = best is not None and best.point.time > 1.01 * found.piece
    over = f"; stars: measured to {found.clock} = {best.point.time:.4g}" if best and farther else ""
    return f"measured to {found.clock} = {found.piece:.4g} and extrapolated{over}"
