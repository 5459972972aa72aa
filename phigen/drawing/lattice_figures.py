"""Figures of runs of lattices: space–time diagrams of chains, snapshots of planes and graphs, errors of invariants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from phigen.drawing.error_curves import HAMILTONIAN
from phigen.drawing.exponents import draw_exponents
from phigen.drawing.palette import SERIES, styled
from phigen.drawing.series_panels import draw_series
from phigen.drawing.shades import shades_of
from phigen.drawing.spectra import draw_correlation, draw_spectrum
from phigen.lattice.placing import placed
from phigen.runtime.lattice import LatticeTrajectory
from phigen.runtime.lattice_series import LatticeSeries
from phigen.study.lattice_errors import BALANCE, CHANGE
from phigen.symbolic.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from phigen.study.lyapunov import Spectrum

#: MOST_PANELS: largest number of coordinates that get a panel. MOST_TIMES: largest number of times in a diagram.
#: SNAPSHOTS: number of snapshots in a row.
MOST_PANELS, MOST_TIMES, SNAPSHOTS = 4, 800, 4
#: Graphs with more sites than this are not drawn with their bonds. A graph is drawn at several times, so figures of
#: larger graphs would be too large as files.
MOST_DRAWN = 100
#: Number of colours of diagrams and of snapshots, limited to keep files small.
LEVELS = 48
#: Height in inches of a panel with the paths of bodies in a plane.
ORBITS_HEIGHT = 5.0
#: Largest number of sites whose names are drawn; more names would overlap in a panel.
MOST_NAMED = 24


@styled
def lattice_figure(
    run: LatticeTrajectory,
    errors: Mapping[str, Floats],
    title: str,
    dots: int = MOST_TIMES,
    spectrum: Spectrum | None = None,
    site_names: Sequence[str] = (),
) -> Figure:
    """Return a figure of the coordinates over space and time, and of the ``errors`` (frames,) by quantity.

    If time, forces or noise change the energy, H(t) is drawn instead of the energy error. For systems of pairs, the
    paths in the plane of the first two coordinates are drawn. ``site_names`` are names of the sites of graphs and
    pairs. If the run has observables, a dynamic structure factor, a correlation or Lyapunov exponents, further panels
    show them. A diagram has at most ``dots`` dots along the time axis.
    """
    from matplotlib.figure import Figure

    orbits = run.solver.interface.pairs and len(run.coordinates) > 1
    names = run.coordinates[: 1 if orbits else MOST_PANELS]
    observed = run.solver.interface.observables[:MOST_PANELS]
    transforms = [2.6] * (run.structure_factor is not None) + [1.8] * (run.correlated is not None)
    moving = not {BALANCE, CHANGE}.isdisjoint(errors)
    errors = {name: error for name, error in errors.items() if name not in (BALANCE, CHANGE)}
    lower_heights = (
        [1.4] * (len(observed) + moving) + [1.8] * bool(errors) + transforms + [1.8] * (spectrum is not None)
    )
    height = ORBITS_HEIGHT if orbits else 2.2
    figure = Figure(figsize=(8.2, height * len(names) + 0.6 + sum(lower_heights)), layout="constrained")
    if title:
        figure.suptitle(title, fontsize=10)
    heights = [height] * len(names) + lower_heights
    parts: Any = figure.subfigures(len(heights), 1, height_ratios=heights)
    if orbits:
        _draw_orbits(parts[0].add_subplot(), run, site_names)
    positions = places_of(run)
    for part, name in zip(parts, () if orbits else names, strict=False):
        values = run.column(name)
        if positions is not None:
            _draw_graph(part, name, run, values, positions, site_names)
        elif values.ndim == 2:
            _draw_diagram(part, name, run, values, dots, site_names)
        else:
            _draw_snapshots(part, name, run, values)
    for k, name in enumerate(observed):
        draw_series(parts[len(names) + k].add_subplot(), name, run.t, run.observed[:, k])
    further = len(names) + len(observed)
    if moving:
        draw_series(parts[further].add_subplot(), HAMILTONIAN, run.t, run.energy)
        further += 1
    if errors:
        _draw_errors(parts[further].add_subplot(), run, errors)
        further += 1
    if run.structure_factor is not None:
        draw_spectrum(parts[further], run.structure_factor)
    if run.correlated is not None:
        draw_correlation(parts[further + len(transforms) - 1].add_subplot(), run.correlated)
    if spectrum is not None:
        draw_exponents(parts[-1].add_subplot(), spectrum)
    return figure


@styled
def series_figure(run: LatticeSeries, title: str) -> Figure:
    """Return a figure of a run that stores numbers but no states, with a curve over time for each number."""
    from matplotlib.figure import Figure

    names = [*run.columns][: 2 * MOST_PANELS]
    figure = Figure(figsize=(8.2, 1.6 * len(names) + 0.6), layout="constrained")
    figure.suptitle(title, fontsize=10)
    for axes, name in zip(np.atleast_1d(figure.subplots(len(names), 1, sharex=True)), names, strict=True):
        draw_series(axes, name, run.t, run.columns[name])
    return figure


@styled
def sites_figure(run: LatticeTrajectory, energies: Floats) -> Figure:
    """Return a figure of the ``energies`` (frames, *sizes) of the sites.

    If sites have Casimirs, a second panel shows the changes of these Casimirs: the largest change of all sites, and the
    standard deviation over the sites.
    """
    from matplotlib.figure import Figure

    local = {name: values for name, values in run.casimirs.items() if values.ndim > 1}
    figure = Figure(figsize=(8.2, 2.6 + 2.0 * bool(local)), layout="constrained")
    heights = [2.4, 2.0] if local else [2.4]
    parts: Any = figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
    if (positions := places_of(run)) is not None:
        _draw_graph(parts[0], "energy", run, energies, positions)
    else:
        draw = _draw_diagram if energies.ndim == 2 else _draw_snapshots
        draw(parts[0], "energy", run, energies)
    if local:
        axes = parts[1].add_subplot()
        for (name, values), colour in zip(local.items(), [*SERIES] * len(local), strict=False):
            change = np.abs(values - values[0]).reshape(len(run), -1)
            for label, errors, style in (("farthest", change.max(axis=1), "-"), ("spread", change.std(axis=1), "--")):
                positive_errors = np.where(errors > 0, errors, np.nan)
                axes.plot(run.t, positive_errors, style, color=colour, label=f"{name}, {label}", linewidth=1.0)
        axes.set_yscale("log")
        axes.set_xlabel("t")
        axes.set_ylabel("change at the sites")
        axes.grid(True)
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2, ncols=4)
    return figure


def _draw_orbits(axes: Any, run: LatticeTrajectory, site_names: Sequence[str]) -> None:
    """Draw the paths of bodies in the plane of their first two coordinates, each with a dot at its end."""
    x, y = run.x[:, 0], run.x[:, 1]
    for site in range(x.shape[1]):
        colour = SERIES[site % len(SERIES)]
        axes.plot(x[:, site], y[:, site], color=colour, linewidth=0.7, alpha=0.8)
        axes.plot(x[-1:, site], y[-1:, site], "o", color=colour, markersize=4)
    for site, text in enumerate(site_names if len(site_names) <= MOST_NAMED else ()):
        axes.annotate(text, (x[-1, site], y[-1, site]), xytext=(5, 4), textcoords="offset points", fontsize=8)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(run.coordinates[0])
    axes.set_ylabel(run.coordinates[1])
    axes.grid(True)


def _draw_diagram(
    part: Any,
    name: str,
    run: LatticeTrajectory,
    values: Floats,
    dots: int = MOST_TIMES,
    site_names: Sequence[str] = (),
) -> None:
    """Draw one coordinate of a chain as a diagram: sites upwards, time to the right."""
    axes = part.add_subplot()
    times = _shown_frames(run, dots)
    image = axes.imshow(
        values[times].T, aspect="auto", origin="lower", interpolation="none",
        extent=(run.t[0], run.t[-1], -0.5, values.shape[1] - 0.5), **shades_of(values, LEVELS),
    )  # fmt: skip
    axes.set_xlabel("t")
    if 0 < len(site_names) <= MOST_NAMED:
        axes.set_yticks(range(len(site_names)), site_names, fontsize=7)
    else:
        axes.set_ylabel(run.axes[0])
    part.colorbar(image, ax=axes, pad=0.02, label=name)


def _shown_frames(run: LatticeTrajectory, dots: int) -> Any:
    """Return the indices of at most ``dots`` frames, which are at about equal intervals of time."""
    apart = np.diff(run.t[:-1])  # the last interval is left out, since it may be shorter
    if len(apart) < 2 or np.ptp(apart) <= 1e-6 * abs(apart[0]):
        return np.linspace(0, len(run) - 1, min(len(run), dots)).astype(int)
    order = np.argsort(run.t)
    times = run.t[order]
    return order[np.searchsorted((times[1:] + times[:-1]) / 2, np.linspace(run.t[0], run.t[-1], dots))]


def places_of(run: LatticeTrajectory) -> Floats | None:
    """Return positions (sites, 2) at which the sites of a graph are drawn; None for grids and for large graphs."""
    if "bonds" not in run.parameters or run.x.shape[2] > MOST_DRAWN:
        return None
    return placed(run.parameters["bonds"], run.x.shape[2])


def _draw_graph(
    part: Any, name: str, run: LatticeTrajectory, values: Floats, positions: Floats, site_names: Sequence[str] = ()
) -> None:
    """Draw the values of one coordinate at the sites of a graph, at several times."""
    frames, shades = _snapshots(run), shades_of(values, LEVELS)
    panels = np.atleast_1d(part.subplots(1, len(frames)))
    for axes, k in zip(panels, frames.tolist(), strict=True):
        markers = draw_sites(axes, run.parameters["bonds"], positions, values[k], shades)
        for position, text in zip(
            positions.tolist(), site_names if len(site_names) <= MOST_NAMED else (), strict=False
        ):
            axes.annotate(text, position, xytext=(4, 3), textcoords="offset points", fontsize=7)
        axes.set_title(f"t = {run.t[k]:.4g}")
    part.colorbar(markers, ax=list(panels), pad=0.02, label=name)


def draw_sites(axes: Any, bonds: Any, positions: Floats, values: Floats, shades: Mapping[str, Any]) -> Any:
    """Draw the sites and bonds of a graph, and return the matplotlib artist of the sites.

    The colours of the sites show the ``values`` (sites,). ``shades`` is the colour map and its scale, as `shades_of`
    returns them.
    """
    from matplotlib.collections import LineCollection

    lines = positions[np.asarray(bonds).reshape(-1, 2)]
    axes.add_collection(LineCollection(lines, colors="0.6", linewidths=0.5, zorder=1))
    markers = axes.scatter(
        *positions.T, c=values, s=min(max(2500 / len(positions), 5.0), 60.0), edgecolors="0.3", linewidths=0.3,
        zorder=2, **shades,
    )  # fmt: skip
    axes.set_aspect("equal")
    axes.margins(0.08)
    axes.set_axis_off()
    return markers


def _snapshots(run: LatticeTrajectory) -> Any:
    """Return the indices of `SNAPSHOTS` frames at about equal intervals, from the first to the last frame."""
    return np.unique(np.linspace(0, len(run) - 1, min(len(run), SNAPSHOTS)).astype(int))


def _draw_snapshots(part: Any, name: str, run: LatticeTrajectory, values: Floats) -> None:
    """Draw ``values`` (frames, *sizes) on a lattice with two axes, as images at several times.

    If the lattice has three axes, the plane in the middle of the first axis is drawn.
    """
    frames = _snapshots(run)
    planes = values if values.ndim == 3 else values[:, values.shape[1] // 2]
    shades = shades_of(planes, LEVELS)
    panels = np.atleast_1d(part.subplots(1, len(frames)))
    for axes, k in zip(panels, frames.tolist(), strict=True):
        image = axes.imshow(planes[k].T, origin="lower", interpolation="none", aspect="equal", **shades)
        axes.set_title(f"t = {run.t[k]:.4g}")
        axes.set_xlabel(run.axes[-2])
    panels[0].set_ylabel(run.axes[-1])
    part.colorbar(image, ax=list(panels), pad=0.02, label=name)


def _draw_errors(axes: Any, run: LatticeTrajectory, errors: Mapping[str, Floats]) -> None:
    for k, (name, error) in enumerate(errors.items()):
        style = {"color": SERIES[k % len(SERIES)], "linestyle": "--" if k >= len(SERIES) else "-"}
        axes.plot(run.t, np.where(error > 0, error, np.nan), label=name, linewidth=1.0, **style)
    axes.set_yscale("log")
    axes.set_xlabel("t")
    axes.set_ylabel("error or change" if any(name.startswith("change") for name in errors) else "error")
    axes.grid(True)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2, ncols=4)
