"""Figures of sweeps: stored results as curves or maps over the dimensions of the sweep."""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from phigen.drawing.palette import SERIES, save, styled
from phigen.errors import FileError
from phigen.spec.names import KEPT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Results to draw if a sweep has no observables. The first one that is in the store is drawn.
_PREFERRED_RESULTS = ("lyapunov", "crossings", "energy_error", "casimir_error", "final")

#: A scale is logarithmic if the ratio of the largest to the smallest value exceeds this number.
_LOGARITHMIC_RATIO = 1e3

#: Largest number of panels of a figure, and of panels in a row.
_PANELS, _COLUMNS = 6, 3

#: Markers by which the curves of a panel differ, in addition to colours.
_MARKERS = ("o", "s", "^", "D", "v", "P")


def draw(store: Path, path: Path, requested: str | None = None, origin: str = "") -> None:
    """Draw the variable ``requested`` of a store into a file.

    By default the observables and their means are drawn. If the sweep has no observables, the first of the
    `_PREFERRED_RESULTS` in the store is drawn. The metadata of the file contain the text ``origin``. Raises `FileError`
    if the store does not contain the variable.
    """
    import xarray

    from phigen.sweeping.store import open_job

    with xarray.open_zarr(str(store), decode_cf=False) as data:
        plan = open_job(str(store)).plan
        observed = [word for word in plan.keep if word not in KEPT]
        drawable = [name for name in (*observed, *_PREFERRED_RESULTS) if name in data]
        if not drawable:
            hint = f"keep one of {', '.join(_PREFERRED_RESULTS)}, or observables, in the sweep"
            raise FileError(f"{store} has nothing that can be drawn over the members\n  hint: {hint}")
        if requested and requested not in drawable:
            raise FileError(f"{store} has no {requested!r} to draw; it has {', '.join(drawable)}")
        names = (
            [requested] if requested else [n for n in observed if not n.startswith(("std(", "error("))] or drawable[:1]
        )
        logarithmic = {axis.name for axis in plan.axes if axis.scale == "log"}
        varied = {axis.name for axis in plan.drawn} | {*plan.listed}
        save(_figure(data, names[:_PANELS], logarithmic, varied), path, origin)


@styled
def _figure(data: Any, names: Sequence[str], logarithmic: Set[str], varied: Set[str]) -> Figure:
    """Return a figure with a panel for each variable. If the variable is a state, each coordinate has a panel.

    If the settings of the members do not form a grid, ``varied`` has the names of the quantities in which members
    differ.
    """
    from matplotlib.figure import Figure

    panels = [panel for name in names for panel in _panels(data, name)][:_PANELS]
    columns = min(len(panels), _COLUMNS)
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(4.6 * columns, 3.8 * rows), layout="constrained")
    for axes, (title, values, errors) in zip(figure.subplots(rows, columns, squeeze=False).flat, panels, strict=False):
        observed = values.name not in _PREFERRED_RESULTS
        subtitle = ""
        if values.dims == ("member",):
            _scatter(figure, axes, data, values, [n for n in data.data_vars if n in varied])
        else:
            subtitle = _over_grid(figure, axes, values, logarithmic, errors, observed=observed)
        if axes.get_xlabel() in logarithmic:
            axes.set_xscale("log")
        if axes.get_ylabel() in logarithmic:
            axes.set_yscale("log")
        axes.set_title(f"{title}{subtitle}")
    for unused in figure.axes[len(panels) : rows * columns]:
        unused.set_axis_off()
    return figure


def _panels(data: Any, name: str) -> Iterator[tuple[str, Any, Any]]:
    """Yield title, values, and standard errors or None, for each panel of a variable."""
    values = data[name]
    if "coordinate" not in values.dims:
        statistic, bracket, argument = name.partition("(")
        errors = f"error({argument}"
        yield name, values, data[errors] if statistic == "mean" and bracket and errors in data else None
        return
    subtitle = ""
    if sites := values.dims[values.dims.index("coordinate") + 1 :]:  # fields of lattices are averaged over the sites
        values, subtitle = values.mean(dim=sites).rename(name), ", mean over the sites"
    for k, coordinate in enumerate(values["coordinate"].values):
        title = f"{name}: {coordinate}" if values.sizes["coordinate"] > 1 else name
        yield f"{title}{subtitle}", values.isel(coordinate=k), None


def _over_grid(figure: Any, axes: Any, panel: Any, logarithmic: Set[str], errors: Any, *, observed: bool) -> str:
    """Draw values as curves or as a map; return a note for the title.

    Values over one dimension are drawn as a curve, and values over two dimensions as a map. If one of the two
    dimensions has few values, an observable is drawn as one curve for each of these values. If there are more than two
    dimensions, the median over the further dimensions is drawn. For observables, the mean over the dimension ``seed``
    (random numbers) is drawn with error bars. The note says which means, medians and errors are shown.
    """
    note = " ± standard error" if errors is not None else ""
    if observed and panel.sizes.get("seed", 1) > 1 and len(panel.dims) > 1:
        draws, panel = panel, panel.mean(dim="seed", skipna=True)
        errors = draws.std(dim="seed", ddof=1, skipna=True) / np.sqrt(draws.notnull().sum(dim="seed"))
        note = f", mean of {draws.sizes['seed']} draws ± standard error"
    dims = [d for d in panel.dims if d != "seed"] or [*panel.dims]
    if fixed_dims := [d for d in panel.dims if d not in dims[:2]]:
        panel, errors, note = panel.median(dim=fixed_dims, skipna=True), None, f", median over {', '.join(fixed_dims)}"
    legend_dim = min(dims[:2], key=lambda d: panel.sizes[d])
    if len(dims) == 1:
        _curve(axes, dims[0], panel, errors, SERIES[0], "o")
    elif observed and panel.sizes[legend_dim] <= len(SERIES):
        (axis_dim,) = (d for d in dims[:2] if d != legend_dim)
        for k, (colour, marker) in enumerate(zip(SERIES[: panel.sizes[legend_dim]], _MARKERS, strict=False)):
            label = f"{legend_dim} = {float(panel[legend_dim][k]):g}"
            bars = None if errors is None else errors.isel({legend_dim: k})
            _curve(axes, axis_dim, panel.isel({legend_dim: k}), bars, colour, marker, label)
        axes.legend()
    else:
        y, x = dims[:2]
        edges = [_edges(np.asarray(panel[d], dtype=float), logarithmic=d in logarithmic) for d in (x, y)]
        image = axes.pcolormesh(*edges, panel.transpose(y, x), rasterized=True, **_colours(panel))
        axes.set(xlabel=x, ylabel=y)
        figure.colorbar(image, ax=axes)
        return note if fixed_dims else ""
    if errors is None and _is_wide(_positive(panel)):
        axes.set_yscale("log")
    return note


def _curve(axes: Any, axis_dim: str, values: Any, errors: Any, colour: str, marker: str, label: str = "") -> None:
    """Draw values over one dimension, with error bars unless ``errors`` is None."""
    style = {"color": colour, "linewidth": 1.2, "label": label or None}
    if errors is None:
        axes.plot(values[axis_dim], values, **style)
    else:
        axes.errorbar(values[axis_dim], values, errors, capsize=2.5, marker=marker, markersize=3, **style)
    axes.set(xlabel=axis_dim)
    axes.grid(True)


def _edges(values: Any, *, logarithmic: bool) -> Any:
    """Return the edges of the cells whose centres are ``values``.

    The edges are midpoints, or geometric means on a logarithmic axis.
    """
    positions = np.log(values) if logarithmic else values
    if len(positions) == 1:
        edges = positions[0] + np.array([-0.5, 0.5])
    else:
        middles = (positions[1:] + positions[:-1]) / 2
        edges = np.concatenate([[2 * positions[0] - middles[0]], middles, [2 * positions[-1] - middles[-1]]])
    return np.exp(edges) if logarithmic else edges


def _scatter(figure: Any, axes: Any, data: Any, panel: Any, names: Sequence[str]) -> None:
    """Draw members as points, if their settings do not form a grid.

    The axes are the first two of the quantities ``names`` in which the members differ.
    """
    if len(names) < 2:
        axes.scatter(data[names[0]] if names else np.arange(panel.size), panel, s=4, color=SERIES[0])
        axes.set(xlabel=names[0] if names else "member")
        return
    dots = axes.scatter(data[names[0]], data[names[1]], c=panel, s=6, **_colours(panel))
    axes.set(xlabel=names[0], ylabel=names[1])
    figure.colorbar(dots, ax=axes)


def _colours(panel: Any) -> dict[str, Any]:
    """Return colour map and scale as keyword arguments.

    The scale is logarithmic if the values are positive and span a wide range.
    """
    from matplotlib.colors import LogNorm

    positive = _positive(panel)
    return {"cmap": "viridis"} | ({"norm": LogNorm(positive.min(), positive.max())} if _is_wide(positive) else {})


def _positive(panel: Any) -> Any:
    """Return the values that are finite and not 0. If one of them is negative, return an empty array."""
    values = np.asarray(panel)
    finite = values[np.isfinite(values) & (values != 0)]
    return finite if finite.size and finite.min() > 0 else finite[:0]


def _is_wide(positive: Any) -> bool:
    return bool(positive.size and positive.max() > _LOGARITHMIC_RATIO * positive.min())
