"""``phigen.sweep``: a sweep from Python, as an xarray Dataset."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from math import prod
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from phigen import resources
from phigen import spec as specs
from phigen.api import _spec_of
from phigen.geometry.system import System
from phigen.runtime import arguments
from phigen.spec import limits
from phigen.spec.model import Axis, Run, Spec, Statistic, Sweep
from phigen.spec.names import KEPT, SWEEP_NAMES
from phigen.spec.runs import with_step
from phigen.spec.sweeps import end_of_its_own

if TYPE_CHECKING:
    import xarray as xr


def sweep(
    source: str | PathLike[str] | Spec | System,
    name: str | None = None,
    *,
    over: Mapping[str, Any] | None = None,
    initial: Sequence[float] | None = None,
    h: float | None = None,
    steps: int | None = None,
    run: str | None = None,
    parameters: Mapping[str, float] | None = None,
    keep: Sequence[str] | None = None,
    frames: int | None = None,
    output: str | PathLike[str] | None = None,
    scheduler: str | None = None,
    workers: int | None = None,
    target: str = "auto",
    order: int | None = None,
    scheme: str | None = None,
    profile: str | None = None,
    progress: Callable[[int, int], Any] | None = None,
) -> xr.Dataset:
    """Make a run for many parameters, initial values or steps; what is kept of each, with the dimensions of ``over``.

    The sweep is that of the spec with this ``name``, the first by default, changed by what is given; without sweeps in
    the spec ``over`` is needed, and without runs ``initial``, ``h`` and ``steps``. ``over`` maps names of parameters,
    coordinates, ``step`` or ``start`` to arrays, or to ``{"from": a, "to": b, "count": n, "scale": "log"}``; without a
    count they are drawn, with ``random: n`` and ``seed: k`` beside them. The result lies in the Zarr store ``output``,
    from which it is read as it is needed; an existing one of the same sweep is gone on with. Without ``output`` it is
    in memory. ``scheduler`` is the address of a Dask cluster; the default are ``workers`` processes of this machine,
    one for each core. ``target``, ``order``, ``scheme`` and ``profile`` are those of `phigen.compile`. ``progress`` is
    told the members made and those of them that failed, chunk by chunk. Scripts that call this need the guard
    ``if __name__ == "__main__":``, as all that start processes do. Raises `SpecError`, `MissingPackageError` without
    dask, distributed, xarray or zarr, ``phigen.errors.FileError`` and `PhigenError`.
    """
    from phigen.sweeping.store import imported
    from phigen.sweeping.sweep import Setting, made

    xarray = imported("xarray")
    spec = _spec(source)
    base = _run_of(spec, run, name, initial, h, steps, parameters)
    chosen = _sweep_of(spec, name, base, over, keep, frames)

    def make(path: Path) -> None:
        setting = Setting(path, scheduler, workers, target, order, scheme, profile)
        made(spec, chosen, base, setting, lambda members: None, progress or (lambda members, failed: None))

    if output is not None:
        make(Path(output))
        return xarray.open_zarr(str(output))
    with tempfile.TemporaryDirectory(prefix="phigen-sweep-") as folder:
        make(Path(folder) / "sweep.zarr")
        with xarray.open_zarr(f"{folder}/sweep.zarr") as data:
            return data.load()


def _spec(source: str | PathLike[str] | Spec | System) -> Spec:
    if isinstance(source, System):
        return source.spec or _spec_of(source)
    spec = source if isinstance(source, Spec) else specs.load(resources.file_of(fspath(source)))
    return spec


def _run_of(
    spec: Spec,
    run: str | None,
    name: str | None,
    initial: Sequence[float] | None,
    h: float | None,
    steps: int | None,
    parameters: Mapping[str, float] | None,
) -> Run:
    """The run that is made many times, with what is given in place of what the spec says."""
    sweep = spec.sweeps.get(name) if name else next(iter(spec.sweeps.values()), None)
    run = run or (sweep.run if sweep else next(iter(spec.runs), None))
    if run is not None and run not in spec.runs:
        raise ValueError(f"there is no run {run!r}; the spec has {', '.join(spec.runs) or 'none'}")
    found = spec.runs[run] if run else None
    if spec.lattice and (found is None or initial is not None):
        raise ValueError("of lattices a run of the spec is needed, with its initial values")
    if found is None and (initial is None or h is None or steps is None):
        raise TypeError("the spec has no runs: initial, h and steps are needed")
    found = found or Run("run", (), Fraction(1), 1)
    given: dict[str, Any] = {} if initial is None else {"initial": tuple(map(Fraction, _numbers(initial, "initial")))}
    if steps is not None:
        given |= {"steps": arguments.count(steps, "steps", 1, limits.STEPS), "duration": None, "until": None}
    if parameters:
        given["parameters"] = {**found.parameters, **_parameters(spec, parameters)}
    found = replace(found, **given)
    found = found if h is None else with_step(found, Fraction(arguments.step_size(h)))
    if len(found.initial) != len(spec.coordinates) and not spec.lattice:
        raise ValueError(f"initial has {len(found.initial)} values for {len(spec.coordinates)} coordinates")
    return found


def _parameters(spec: Spec, given: Mapping[str, float]) -> dict[str, Fraction]:
    """Values of parameters that are the same for all members."""
    arguments.expect_known(given, {p.name: 0.0 for p in spec.parameters})
    values = {name: arguments.number(value, f"parameter {name!r}") for name, value in given.items()}
    for p in spec.parameters:
        if p.positive and values.get(p.name, 1.0) <= 0:
            raise ValueError(f"parameter {p.name!r} must be positive, not {values[p.name]}")
    return {name: Fraction(value) for name, value in values.items()}


def _numbers(given: Any, what: str) -> list[float]:
    """A list of finite numbers."""
    return arguments.array(given, what, (len(given),) if np.ndim(given) else (1,)).tolist()  # type: ignore[no-any-return]


def _sweep_of(
    spec: Spec,
    name: str | None,
    run: Run,
    over: Mapping[str, Any] | None,
    keep: Sequence[str] | None,
    frames: int | None,
) -> Sweep:
    if name is not None and name not in spec.sweeps:
        raise ValueError(f"there is no sweep {name!r}; the spec has {', '.join(spec.sweeps) or 'none'}")
    found = spec.sweeps[name] if name else next(iter(spec.sweeps.values()), None)
    if found is None and over is None:
        raise TypeError("the spec has no sweeps: over is needed")
    found = found or Sweep("sweep", run.name)
    given: dict[str, Any] = {"run": run.name}
    if over is not None:
        words = _words(over, spec)
        axes = tuple(_axis(key, value, spec) for key, value in over.items() if key not in words)
        given |= {"over": axes, "random": 0, "seed": 0, "file": "", **words}
    if isinstance(keep, str):
        raise TypeError(f"keep must be a list of names, [{keep!r}], not {keep!r}")
    given |= {} if keep is None else {"keep": tuple(dict.fromkeys(keep))}
    given |= {} if frames is None else {"frames": arguments.count(frames, "frames", 0)}
    found = replace(found, **given)
    if end := end_of_its_own(found, run, monitored=spec.monitor is not None):
        raise ValueError(f"{end}; give it steps in place of that")
    strange = [what for what in found.keep if what not in KEPT and Statistic.read(what, spec.observables) is None]
    if strange:
        known = ", ".join([*KEPT, *spec.observables, *(f"mean({n}), std({n})" for n in spec.observables)])
        raise ValueError(f"cannot keep {strange[0]!r}; there are {known}")
    if "crossings" in found.keep and run.section is None:
        raise ValueError(f"crossings: the run {run.name} has no section")
    if "energy_error" in found.keep and spec.time:
        raise ValueError("energy_error: H depends on the time, so energy is not conserved")
    drawn = [axis.name for axis in found.over if not axis.size]
    if drawn and not found.random and not any(axis.name == "seed" for axis in found.over):
        raise ValueError(f"over: {drawn[0]} has no count, and there is neither random nor seed")
    if found.random and len(drawn) < len(found.over):
        raise ValueError("over: random members are drawn, so there are no counts and no lists")
    if found.file and (found.over or found.random):
        raise ValueError("over: a file has all values; it stands alone")
    if not (found.over or found.file):
        raise ValueError("over: there is nothing to vary")
    members = found.random or prod(axis.size for axis in found.over if axis.size)
    if members > limits.SWEPT:
        raise ValueError(f"over: {members} members, the limit is {limits.SWEPT}")
    return found


def _words(over: Mapping[str, Any], spec: Spec) -> dict[str, Any]:
    """What ``over`` says besides ranges; these names may be those of parameters too, of which there are ranges."""
    if not isinstance(over, Mapping):
        raise TypeError(f"over must map names to ranges or lists, not {over!r}")
    parameters = {p.name for p in spec.parameters}
    found: dict[str, Any] = {}
    for key, least, most in (("random", 1, limits.SWEPT), ("seed", 0, limits.SWEEP_SEED)):
        if key in over and key not in parameters and not (key == "seed" and isinstance(over[key], Mapping)):
            found[key] = arguments.count(over[key], f"over: {key}", least, most)
    if "file" in over and "file" not in parameters:
        found["file"] = fspath(over["file"])
    return found


def _axis(name: str, value: Any, spec: Spec) -> Axis:
    known = [*(p.name for p in spec.parameters), *(() if spec.lattice else spec.coordinates), *SWEEP_NAMES]
    if name not in known:
        raise ValueError(f"over: {name!r} is not a parameter or a coordinate; there are {', '.join(known)}")
    if name == "start" and name not in known[: -len(SWEEP_NAMES)] and not spec.time:
        raise ValueError("over: start: this system has no time")
    numbers_draws = name == "seed" and name not in known[: -len(SWEEP_NAMES)]
    if isinstance(value, Mapping):
        return _draws(value) if numbers_draws else _range(name, value)
    values = _numbers(value, f"over: {name}") if np.ndim(value) else []
    if not values:
        raise ValueError(f"over: {name} must be a range, or a list of finite numbers")
    return Axis(name, tuple(values))


def _draws(value: Mapping[str, Any]) -> Axis:
    """The numbers of draws, along a dimension of the sweep."""
    if set(value) != {"count"}:
        raise ValueError(f"over: seed numbers draws: it has a count, and nothing else, not {dict(value)!r}")
    return Axis("seed", count=arguments.count(value["count"], "over: seed: count", 1, limits.SWEPT))


def _range(name: str, value: Mapping[str, Any]) -> Axis:
    """The axis of a range in words."""
    for word in (*value, "from", "to"):
        if word not in ("from", "to", "count", "scale") or word not in value:
            raise ValueError(f"over: {name} needs from and to, and may have count and scale, not {dict(value)!r}")
    first, last = (arguments.number(value.get(end, 0), f"over: {name}: {end}") for end in ("from", "to"))
    count = arguments.count(value["count"], f"over: {name}: count", 1, limits.SWEPT) if "count" in value else 0
    scale = value.get("scale", "linear")
    if scale not in ("linear", "log"):
        raise ValueError(f"over: {name}: scale must be linear or log, not {scale!r}")
    if scale == "log" and min(first, last) <= 0:
        raise ValueError(f"over: {name} on a logarithmic scale reaches {min(first, last):g}")
    return Axis(name, (), (first, last), count, scale)
