"""Plots of the error of the modified Hamiltonian: along a trajectory, and as a function of the step size.

The error is the change of the modified Hamiltonian since the start of the trajectory.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from phigen.drawing.error_curves import LINES, ROUNDING, windowed_maxima
from phigen.drawing.palette import MARK, SERIES
from phigen.study.backward import Constancy


def draw_along(axes: Any, constancy: Constancy) -> None:
    """Draw the error of the modified Hamiltonian H̃ over time, with a curve for each number of corrections."""
    for m, errors in enumerate(constancy.errors):
        t, values = windowed_maxima(constancy.times, errors)
        axes.plot(t, np.where(values > 0, values, np.nan), linewidth=1.0, **_style(m))
    axes.set(xlabel="t", yscale="log", title=f"change of H̃ along steps of {constancy.step:.4g}")
    _finish(axes)


def draw_against_step(axes: Any, constancy: Constancy) -> None:
    """Draw the largest error of the modified Hamiltonian H̃ against the step size."""
    for m, power in enumerate(constancy.powers):
        changes = constancy.changes[:, m]
        axes.plot(constancy.sizes, np.where(changes > 0, changes, np.nan), linewidth=1.0, marker="osD"[m % 3],
                  markersize=3, markeredgewidth=0, **_style(m), label=_label(m, constancy))  # fmt: skip
        measurable = np.flatnonzero(changes > 30 * ROUNDING)
        if len(measurable) > 1:
            step_range = constancy.sizes[measurable[[0, -1]]]
            axes.plot(step_range, 2.0 * changes[measurable[-1]] * (step_range / step_range[-1]) ** power,
                      color=SERIES[m], linewidth=0.6, alpha=0.7, zorder=1)  # fmt: skip
    axes.set(xlabel="step h", xscale="log", yscale="log", title=f"largest change up to t = {constancy.end:.4g}")
    _finish(axes)
    axes.axhline(ROUNDING, **MARK)
    axes.legend(loc="best")


def _label(m: int, constancy: Constancy) -> str:
    name = "H" if m == 0 else f"{m} correction{'s' * (m > 1)}"
    slope = f"slope {constancy.observed[m]:.2f}" if math.isfinite(constancy.observed[m]) else "at rounding"
    return f"{name}: {slope}"


def _style(m: int) -> dict[str, Any]:
    return {"color": SERIES[m % len(SERIES)], "linestyle": LINES[m % len(LINES)], "zorder": 3 - 0.1 * m}


def _finish(axes: Any) -> None:
    axes.grid(True)
    axes.minorticks_off()
