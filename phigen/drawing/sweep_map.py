"""Maps of sweeps: a stored result of each member over two of the dimensions."""

from __future__ import annotations

from collections.abc import Set
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from phigen.drawing.palette import SERIES, save, styled
from phigen.errors import FileError
from phigen.spec.names import KEPT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Results other than observables, in the order in which the default to draw is chosen.
_FIRST = ("lyapunov", "crossings", "energy_error", "casimir_error", "final")

#: Values that span more than this factor are drawn on a logarithmic scale.
_WIDE = 1e3

_PANELS = 6


def draw(store: Path, path: Path, shown: str | None = None) -> None:
    """Draw a variable of a store into a file. Raises `FileError` if the store has no variable with this name."""
    import xarray

    from phigen.sweeping.store import open_job

    with xarray.open_zarr(str(store), decode_cf=False) as data:
        plan = open_job(str(store)).plan
        observed = [word for word in plan.keep if word not in KEPT]
        known = [name for name in (*observed, *_FIRST) if name in data]
        if not known:
            hint = f"keep one of {', '.join(_FIRST)}, or observables, in the sweep"
            raise FileError(f"{store} has nothing that can be drawn over the members\n  hint: {hint}")
        chosen = shown or known[0]
        if chosen not in known:
            raise FileError(f"{store} has no {chosen!r} to draw; it has {', '.join(known)}")
        logarithmic = {axis.name for axis in plan.axes if axis.scale == "log"}
        errors = f"error({chosen.removeprefix('mean(')}"
        save(_figure(data.drop_vars([w for w in observed if w not in (chosen, errors)]), chosen, logarithmic), path)


@styled
def _figure(data: Any, name: str, logarithmic: Set[str]) -> Figure:
    from matplotlib.figure import Figure

    values = data[name]
    sites = values.dims[values.dims.index("coordinate") + 1 :] if "coordinate" in values.dims else ()
    if sites:  # fields of lattices are averaged over the sites
        values = values.mean(dim=sites)
    panels = [values]
    if "coordinate" in values.dims:
        panels = [values.isel(coordinate=k) for k in range(min(values.sizes["coordinate"], _PANELS))]
    titles = [str(c) for c in data["coordinate"].values] if len(panels) > 1 else [name]
    figure = Figure(figsize=(4.6 * len(panels), 3.8), layout="constrained")
    for axes, panel, title in zip(np.ravel(figure.subplots(1, len(panels))), panels, titles, strict=False):
        if panel.dims == ("member",):
            _scatter(figure, axes, data, panel)
        else:
            _over_grid(figure, axes, panel, logarithmic, _errors(data, name), observed=name not in _FIRST)
        if axes.get_xlabel() in logarithmic:
            axes.set_xscale("log")
        if axes.get_ylabel() in logarithmic:
            axes.set_yscale("log")
        shown = title if title == name else f"{name}: {title}"
        axes.set_title(f"{shown}, mean over the sites" if sites else shown)
    return figure


def _errors(data: Any, name: str) -> Any:
    """Return the stored standard errors of the mean of an observable; None for other variables."""
    of, opened, rest = name.partition("(")
    errors = f"error({rest}"
    return data[errors] if of == "mean" and opened and errors in data else None


def _over_grid(figure: Any, axes: Any, panel: Any, logarithmic: Set[str], errors: Any, *, observed: bool) -> None:
    """Draw a curve over one dimension or a map over two; the median is taken over further dimensions, draws first.

    Along one dimension, means of observables over draws have error bars, as have variables with ``errors``.
    """
    dims = [*panel.dims]
    if "seed" in dims and len(dims) == 2 and panel.sizes["seed"] > 1 and observed:
        draws, panel = panel, panel.mean(dim="seed", skipna=True)
        errors = draws.std(dim="seed", ddof=1, skipna=True) / np.sqrt(draws.notnull().sum(dim="seed"))
    if len(panel.dims) == 1 and errors is not None:
        (along,) = panel.dims
        axes.errorbar(
            panel[along], panel, errors, color=SERIES[0], linewidth=1.2, capsize=2.5, marker="o", markersize=3
        )
        axes.set(xlabel=along)
        axes.grid(True)
        return
    dims = [d for d in panel.dims if d != "seed"] or [*panel.dims]
    more = [d for d in panel.dims if d not in dims[:2]]
    panel = panel.median(dim=more, skipna=True) if more else panel
    if len(dims) == 1:
        axes.plot(panel[dims[0]], panel, color=SERIES[0], linewidth=1.2)
        axes.set(xlabel=dims[0], yscale="log" if _is_wide(_positive(panel)) else "linear")
        axes.grid(True)
        return
    y, x = dims[:2]
    edges = [_edges(np.asarray(panel[d], dtype=float), logarithmic=d in logarithmic) for d in (x, y)]
    image = axes.pcolormesh(*edges, panel.transpose(y, x), rasterized=True, **_colours(panel))
    axes.set(xlabel=x, ylabel=y)
    figure.colorbar(image, ax=axes)


def _edges(values: Any, *, logarithmic: bool) -> Any:
    """Return the edges of cells around values: midpoints, or geometric midpoints on a logarithmic axis."""
    places = np.log(values) if logarithmic else values
    if len(places) == 1:
        edges = places[0] + np.array([-0.5, 0.5])
    else:
        middles = (places[1:] + places[:-1]) / 2
        edges = np.concatenate([[2 * places[0] - middles[0]], middles, [2 * places[-1] - middles[-1]]])
    return np.exp(edges) if logarithmic else edges


def _scatter(figure: Any, axes: Any, data: Any, panel: Any) -> None:
    """Draw members without a grid as points over the first two quantities in which they differ."""
    results = (*_FIRST, "status", panel.name)
    names = [n for n in data.data_vars if data[n].dims == ("member",) and n not in results and "(" not in n][:2]
    if len(names) < 2:
        axes.scatter(data[names[0]] if names else np.arange(panel.size), panel, s=4, color=SERIES[0])
        axes.set(xlabel=names[0] if names else "member")
        return
    dots = axes.scatter(data[names[0]], data[names[1]], c=panel, s=6, **_colours(panel))
    axes.set(xlabel=names[0], ylabel=names[1])
    figure.colorbar(dots, ax=axes)


def _colours(panel: Any) -> dict[str, Any]:
    """Return the colour scale: logarithmic where values are positive and span a wide range. NaN is left out."""
    from matplotlib.colors import LogNorm

    good = _positive(panel)
    return {"cmap": "viridis"} | ({"norm": LogNorm(good.min(), good.max())} if _is_wide(good) else {})


def _positive(panel: Any) -> Any:
    """Return the non-zero values if all of them are positive; else an empty array."""
    values = np.asarray(panel)
    good = values[np.isfinite(values) & (values != 0)]
    return good if good.size and good.min() > 0 else good[:0]


def _is_wide(positive: Any) -> bool:
    return bool(positive.size and positive.max() > _WIDE * positive.min())
