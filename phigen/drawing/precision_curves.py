"""Plots of errors against step size and against computing time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from phigen.drawing.error_curves import LINES
from phigen.drawing.palette import MARK, SERIES
from phigen.study.precision import PrecisionCurve, Study

_MARKERS = "osD^vX"


def draw_convergence(axes: Any, study: Study) -> None:
    """Draw errors against step size.

    The labels state the observed orders. A thin line has the slope that the order of the first method predicts.
    """
    for index, curve in enumerate(study.curves):
        slope = f"slope {curve.slope:.2f}" if math.isfinite(curve.slope) else "slope unknown"
        _draw(axes, index, [p.step for p in curve.points], [p.error for p in curve.points], f"{label(curve)}: {slope}")
    _draw_slope(axes, study.curves[0])
    axes.set(xlabel="step h", ylabel=f"relative error at {study.clock} = {study.time:.4g}")
    _finish(axes, study.floor)


def draw_work(axes: Any, study: Study) -> None:
    """Draw errors of the solution against the computing time of a run in seconds."""
    for index, curve in enumerate(study.curves):
        _draw(axes, index, [p.seconds for p in curve.points], [p.error for p in curve.points], label(curve))
    axes.set(xlabel="seconds of the run", title=f"relative error of the solution at {study.clock} = {study.time:.4g}")
    _finish(axes, study.floor)


def draw_conserved(axes: Any, study: Study) -> None:
    """Draw the largest error of a Casimir against the computing time of a run in seconds."""
    for index, curve in enumerate(study.curves):
        _draw(axes, index, [p.seconds for p in curve.points], [p.casimirs for p in curve.points], label(curve))
    axes.set(xlabel="seconds of the run", title=f"relative error of the Casimirs at {study.clock} = {study.time:.4g}")
    _finish(axes)


def label(curve: PrecisionCurve) -> str:
    """Return the name of a method with its order."""
    return f"{curve.label} (order {curve.order})"


def _draw(axes: Any, index: int, x: Sequence[float], y: Sequence[float], text: str) -> None:
    axes.plot(
        x, y, linestyle=LINES[index % len(LINES)], color=SERIES[index % len(SERIES)], label=text, linewidth=1.0,
        marker=_MARKERS[index % len(_MARKERS)], markersize=3, markeredgewidth=0, zorder=3 - 0.1 * index,
    )  # fmt: skip


def _draw_slope(axes: Any, curve: PrecisionCurve) -> None:
    fitted = [p for p in curve.points if 1e-12 < p.error < 1e-2]
    if len(fitted) > 1 and math.isfinite(curve.slope):
        step_range, scale = [fitted[0].step, fitted[-1].step], 2.0 * fitted[-1].error / fitted[-1].step ** curve.order
        axes.plot(
            step_range,
            [scale * h**curve.order for h in step_range],
            color=SERIES[0],
            linewidth=0.6,
            alpha=0.7,
            zorder=1,
        )


def _finish(axes: Any, floor: float | None = None) -> None:
    axes.set(xscale="log", yscale="log")
    if floor is not None:
        axes.axhline(floor, **MARK)
    axes.grid(True)
    axes.minorticks_off()
    axes.legend(loc="best")
