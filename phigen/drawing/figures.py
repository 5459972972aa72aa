"""Figures of runs: trajectories, errors of conserved quantities, Poincaré sections, convergence, work.

Each function returns a `matplotlib.figure.Figure`, and does not change matplotlib's global state. Colours are those of
`phigen.drawing.palette.PALETTE`. The functions `save` and `svg` of that module give reproducible output.
matplotlib is an optional dependency, in the extra ``plot``; without it, every function raises `MissingPackageError`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

from phigen.drawing import (
    backward_curves,
    error_curves,
    exponents,
    phase_space,
    precision_curves,
    section_plane,
    series_panels,
    tuning_curves,
)
from phigen.drawing.lettering import move_apart
from phigen.drawing.palette import PALETTE, SUFFIXES, save, styled, svg
from phigen.geometry.conservation import Unit
from phigen.runtime.trajectory import Trajectory
from phigen.study.backward import Constancy
from phigen.study.precision import Study
from phigen.symbolic.arrays import Floats
from phigen.symbolic.expression import Expression

if TYPE_CHECKING:
    from matplotlib.figure import Figure, FigureBase

    from phigen.study.lyapunov import Spectrum
    from phigen.tuning.study import Tuning

__all__ = ["PALETTE", "SUFFIXES", "WIDTH", "constancy_figure", "convergence_figure", "error_figure",
           "lyapunov_figure", "run_figure", "save", "section_figure", "svg", "trajectory_figure", "tuning_figure",
           "work_precision_figure"]  # fmt: skip

#: Widths of a page and of a single panel in inches. PNG files have 200 dots per inch.
WIDTH, NARROW = 7.2, 4.8
_SECTION, _SQUARE = 3.4, 3.8


@styled
def trajectory_figure(trajectory: Trajectory, casimirs: Mapping[str, Expression]) -> Figure:
    """Return a figure of a trajectory in phase space: a plot of two coordinates, a three-dimensional plot, or several
    projections.

    For three coordinates, the symplectic leaf is drawn too. This is the surface on which the first of the ``casimirs``
    (formulas by name) has its initial value.
    """
    _, columns = phase_space.grid(trajectory.coordinates)
    figure = _figure(phase_space.height(trajectory.coordinates), WIDTH if columns > 1 else NARROW)
    phase_space.draw_trajectory(figure, trajectory, casimirs)
    move_apart(figure)
    return figure


@styled
def error_figure(methods: Mapping[str, Trajectory], units: Mapping[str, Unit] | None = None) -> Figure:
    """Return a figure with the errors of energy and Casimirs against time, for several methods.

    Each quantity has a panel. Errors are in the ``units`` of `phigen.geometry.conservation.units_of`. A long run is
    divided into some hundred intervals of time, and only the largest error in each interval is drawn. Errors of 0 are
    drawn at a separate tick. A cross marks the time at which a method failed.
    """
    figure = _figure(error_curves.height(methods))
    error_curves.draw_errors(figure, methods, units)
    return figure


@styled
def section_figure(sections: Mapping[str, Floats], names: Sequence[str]) -> Figure:
    """Return a figure of Poincaré sections; ``sections`` maps labels to arrays of points (rows, DIM).

    ``names`` lists the DIM coordinates. Two of these coordinates, which `section_plane.plane_of` chooses, are drawn.
    """
    figure = _figure(_SECTION, NARROW)
    section_plane.draw_section(figure.add_subplot(), sections, names)
    return figure


@styled
def convergence_figure(study: Study) -> Figure:
    """Return a figure of final errors against the step size, with a curve for each method.

    A thin line has the slope that the order of the first method predicts.
    """
    figure = _figure(_SQUARE, NARROW)
    precision_curves.draw_convergence(figure.add_subplot(), study)
    return figure


@styled
def work_precision_figure(study: Study) -> Figure:
    """Return a figure of the final errors of solution and Casimirs against the computing time."""
    panels = [precision_curves.draw_work, precision_curves.draw_conserved][: 1 + study.has_casimirs]
    figure = _figure(_SQUARE, WIDTH if len(panels) > 1 else NARROW)
    for axes, draw in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        draw(axes, study)
    return figure


@styled
def tuning_figure(tuning: Tuning, title: str = "") -> Figure:
    """Return a figure of errors against computing time for all settings that a tuning has tried.

    Stars mark the proposed steps.
    """
    figure = _figure(1.2 * _SQUARE, WIDTH)
    if title:
        figure.suptitle(title, fontsize=11)
    tuning_curves.draw_tuning(figure.add_subplot(), tuning)
    return figure


@styled
def constancy_figure(constancy: Constancy) -> Figure:
    """Return a figure of the errors of H and of the modified Hamiltonian H̃: along a trajectory, and against the step
    size.
    """
    figure = _figure(_SQUARE)
    time_panel, step_panel = figure.subplots(1, 2)
    backward_curves.draw_along(time_panel, constancy)
    backward_curves.draw_against_step(step_panel, constancy)
    return figure


@styled
def run_figure(
    methods: Mapping[str, Trajectory],
    casimirs: Mapping[str, Expression],
    sections: Mapping[str, Floats] | None = None,
    title: str = "",
    spectrum: Spectrum | None = None,
    units: Mapping[str, Unit] | None = None,
) -> Figure:
    """Return one figure with all plots of a run.

    The figure shows the trajectory of the first method with its Poincaré sections and observables, the errors of all
    methods, and the Lyapunov exponents if there is a ``spectrum``.
    """
    first = next(iter(methods.values()))

    def draw_section(part: FigureBase) -> None:
        section_plane.draw_section(part.add_subplot(), sections or {}, first.coordinates)

    def draw_trajectory(part: FigureBase) -> None:
        phase_space.draw_trajectory(part, first, casimirs)

    rows: list[tuple[float, list[Callable[[FigureBase], None]]]]
    rows = [(phase_space.height(first.coordinates), [draw_trajectory])]
    if sections and phase_space.grid(first.coordinates) == (1, 1):
        rows[0][1].append(draw_section)  # a trajectory in a single panel leaves space for the section beside it
    elif sections:
        rows.append((_SECTION, [draw_section]))
    errors: Callable[[FigureBase], None] = partial(error_curves.draw_errors, methods=methods, units=units)
    if first.observables:
        draw_observables = partial(series_panels.draw_observables, t=first.t, observables=first.observables)
        rows.append((series_panels.height(first.observables), [draw_observables]))
    rows.append((error_curves.height(methods), [errors]))
    if spectrum:
        rows.append((exponents.HEIGHT, [lambda part: exponents.draw_exponents(part.add_subplot(), spectrum)]))
    heights = [height for height, _ in rows]
    figure = _figure(sum(heights))
    if title:
        figure.suptitle(title, fontsize=11)
    subfigures = figure.subfigures(len(rows), 1, height_ratios=heights, squeeze=False)[:, 0]
    for subfigure, (_, parts) in zip(subfigures, rows, strict=True):
        for part, draw in zip(
            subfigure.subfigures(1, len(parts), width_ratios=[1.1, 1][: len(parts)], squeeze=False)[0],
            parts,
            strict=True,
        ):
            draw(part)
    move_apart(figure)
    return figure


@styled
def lyapunov_figure(spectrum: Spectrum) -> Figure:
    """Return a figure of the Lyapunov exponents of a trajectory, which converge with the averaging time."""
    figure = _figure(exponents.HEIGHT, NARROW)
    exponents.draw_exponents(figure.add_subplot(), spectrum)
    return figure


def _figure(height: float, width: float = WIDTH) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")
