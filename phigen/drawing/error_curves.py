"""Errors of conserved quantities over time, on a logarithmic scale with an additional tick for 0."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from phigen.drawing.palette import MARK, SERIES
from phigen.geometry.conservation import ENERGY, Unit, unit_of
from phigen.runtime.trajectory import Trajectory
from phigen.symbolic.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

#: A long run is divided into this number of windows; only the largest error in each window is drawn.
WINDOWS = 400
#: Title of the panel that shows H over time, for systems that do not conserve H.
HAMILTONIAN = "H(t)"
#: Height of a row of panels in inches.
ROW = 2.3
#: Distance from 1 to the next double. Relative errors of this size are rounding errors, so panels have a line at this
#: size.
ROUNDING = 2.0**-52

LINES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (5, 1.2, 1.2, 1.2)), (0, (8, 2)), (0, (2.5, 1)))


def windowed_maxima(t: Floats, values: Floats, windows: int = WINDOWS) -> tuple[Floats, Floats]:
    """Return the largest value in each window, and the time of that value. A window consists of successive rows.

    A window with a value that is not finite gives NaN. All rows are returned if there are at most twice as many rows as
    windows.
    """
    if len(t) <= 2 * windows:
        return t, np.where(np.isfinite(values), values, np.nan)
    parts = np.array_split(np.arange(len(t)), windows)
    finite = np.where(np.isfinite(values), values, np.inf)
    peak_rows = np.array([part[np.argmax(finite[part])] for part in parts])
    return t[peak_rows], np.where(np.isfinite(values[peak_rows]), values[peak_rows], np.nan)


def grid(methods: Mapping[str, Trajectory]) -> tuple[int, int]:
    """Return the numbers of rows and columns of the panels of `draw_errors`."""
    panels = 1 + len(next(iter(methods.values())).casimirs)
    columns = panels if panels <= 3 else 2 if panels == 4 else 3
    return -(-panels // columns), columns


def height(methods: Mapping[str, Trajectory]) -> float:
    """Return the height of all panels together, in inches."""
    return ROW * grid(methods)[0]


def draw_errors(
    figure: FigureBase,
    methods: Mapping[str, Trajectory],
    units: Mapping[str, Unit] | None = None,
) -> None:
    """Draw a panel for the energy and one for each Casimir, with a curve for each method.

    The first method is drawn on top. Errors are in ``units``. Without units, they are relative to the initial value, or
    absolute if the initial value is 0. If time, forces or noise change a quantity, the panel shows its values, such as
    H(t), instead of its errors.
    """
    first = next(iter(methods.values()))
    panels = [ENERGY, *first.casimirs]
    rows, columns = grid(methods)
    shared_axis: Any = None
    for index, name in enumerate(panels, start=1):
        axes = figure.add_subplot(rows, columns, index, sharex=shared_axis)
        shared_axis = shared_axis or axes
        values = {label: t.energy if index == 1 else t.casimirs[name] for label, t in methods.items()}
        unit = (units or {}).get(name) or unit_of(float(next(iter(values.values()))[0]), 0.0)
        if units is None:
            unit = replace(unit, moves=name in first.moving)
        quantity = "energy" if index == 1 else f"Casimir {name}"
        if unit.moves:
            _draw_values(axes, {label: (methods[label].t, column) for label, column in values.items()})
            axes.set_title(f"change of the energy, {HAMILTONIAN}" if index == 1 else f"change of the {quantity}")
        else:
            curves = {
                label: windowed_maxima(methods[label].t, unit.errors(column, float(column[0])))
                for label, column in values.items()
            }
            _draw_panel(axes, curves)
            axes.set_title(f"{unit.adjective} error{' of the' if columns < 3 else ':'} {quantity}")
        if index > len(panels) - columns:
            axes.set_xlabel("t")
    if len(methods) > 1:
        handles, labels = shared_axis.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(methods))


def _draw_values(axes: Any, curves: Mapping[str, tuple[Floats, Floats]]) -> None:
    axes.grid(True)
    for index, (label, (t, values)) in enumerate(curves.items()):
        style: dict[str, Any] = {"color": SERIES[index % len(SERIES)], "zorder": 3 - 0.1 * index}
        axes.plot(t, values, linestyle=LINES[index % len(LINES)], linewidth=1.0, label=label, **style)


def _draw_panel(axes: Any, curves: Mapping[str, tuple[Floats, Floats]]) -> None:
    positive = np.concatenate([values[values > 0] for _, values in curves.values()])
    low, high = (positive.min(), positive.max()) if len(positive) else (ROUNDING, ROUNDING)
    lowest, highest = math.floor(math.log10(low)), max(math.ceil(math.log10(high)), math.floor(math.log10(low)) + 1)
    # A logarithmic scale has no place for 0, so errors of 0 are drawn one decade below the smallest error.
    zeros = any((values == 0).any() for _, values in curves.values())
    zero = 10.0 ** (lowest - 0.8)
    axes.set(yscale="log", ylim=(10.0 ** (lowest - (1.4 if zeros else 0.1)), 10.0 ** (highest + 0.1)))
    _set_ticks(axes, lowest, highest, zero if zeros else None)
    axes.grid(True)
    axes.axhline(ROUNDING, **MARK)
    for index, (label, (t, values)) in enumerate(curves.items()):
        style: dict[str, Any] = {"color": SERIES[index % len(SERIES)], "zorder": 3 - 0.1 * index}
        line = LINES[index % len(LINES)]
        axes.plot(t, np.where(values > 0, values, np.nan), linestyle=line, linewidth=1.0, label=label, **style)
        none = t[values == 0]
        axes.plot(none, np.full(len(none), zero), ".", markersize=2.5, markeredgewidth=0, **style)
        if len(undefined_rows := np.flatnonzero(np.isnan(values))) and undefined_rows[0] > 0:
            last = undefined_rows[0] - 1
            axes.plot(t[last], max(values[last], zero), "x", markersize=6, markeredgewidth=1.5, **style)


def _set_ticks(axes: Any, lowest: int, highest: int, zero: float | None) -> None:
    """Set at most six ticks at powers of ten. Unless ``zero`` is None, set a further tick "0" at this position."""
    powers = range(highest, lowest - 1, -max(1, math.ceil((highest - lowest) / 5)))
    positions, labels = [10.0**p for p in powers], [f"$10^{{{p}}}$" for p in powers]
    axes.set_yticks([*positions, zero] if zero else positions, [*labels, "0"] if zero else labels)
    axes.tick_params(axis="y", which="minor", length=0)
