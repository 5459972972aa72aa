"""The function ``phigen.sweep``, which computes a sweep and returns the results as an xarray Dataset."""

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
from phigen.api import _spec_of, expect_runnable
from phigen.geometry.system import System
from phigen.runtime import arguments
from phigen.spec import limits
from phigen.spec.model import Axis, Run, Spec, Statistic, SweepSettings
from phigen.spec.names import KEPT, STATISTICS, SWEEP_NAMES
from phigen.spec.runs import with_step
from phigen.spec.sweeps import average_obstacle, end_of_its_own

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
    target: str | None = None,
    order: int | None = None,
    scheme: str | None = None,
    profile: str | None = None,
    progress: Callable[[int, int], Any] | None = None,
) -> xr.Dataset:
    """Repeat a run for many parameters, initial values or steps, and return the results as a Dataset.

    Each repetition is a *member* of the sweep. The sweep is the one called ``name`` in the spec, the first by default;
    other arguments replace its settings. If the spec has no sweep, ``over`` is required; if it has no run, ``initial``,
    ``h`` and ``steps`` are required. ``over`` maps names of parameters, coordinates, ``step`` or ``start`` to arrays,
    or to ``{"from": a, "to": b, "count": n, "scale": "log"}``. Without a count the values are random, and ``over`` must
    also contain ``random: n`` and ``seed: k``.

    With ``output``, the results are stored in the Zarr store of this name, and loaded on demand; an existing store of
    the same sweep is continued. Otherwise the results are in memory. ``scheduler`` is the address of a Dask cluster. If
    there is none, ``workers`` processes of this machine are used, by default one for each core, or for each device of
    the target. ``target``, ``order``, ``scheme`` and ``profile`` have the meaning that they have in `phigen.compile`.
    ``progress`` receives the numbers of computed and of failed members after each chunk.

    The function starts processes, so scripts that call it need the guard ``if __name__ == "__main__":``. Raises
    `MissingPackageError` if dask, distributed, xarray or zarr is missing; `SpecError`; ``phigen.errors.FileError`` if
    the store contains another sweep; and other errors of the class `PhigenError`.
    """
    from phigen.sweeping.store import imported
    from phigen.sweeping.sweep import SweepSetting, made

    xarray = imported("xarray")
    if target is not None:
        expect_runnable(target)
    spec = _spec(source)
    base = _run_of(spec, run, name, initial, h, steps, parameters)
    chosen = _sweep_of(spec, name, base, over, keep, frames)

    def make(path: Path) -> None:
        setting = SweepSetting(path, scheduler, workers, target, order, scheme, profile)
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
    """Return the run to repeat: a run of the spec, with the arguments of the call in place of its settings.

    ``run`` is the name of the run; the default is the run of the sweep ``name``.
    """
    sweep = spec.sweeps.get(name) if name else next(iter(spec.sweeps.values()), None)
    run = run or (sweep.run if sweep else next(iter(spec.runs), None))
    if run is not None and run not in spec.runs:
        raise ValueError(f"there is no run {run!r}; the spec has {', '.join(spec.runs) or 'none'}")
    base = spec.runs[run] if run else None
    if spec.lattice and (base is None or initial is not None):
        raise ValueError("a lattice needs a run of the spec, for its initial values")
    if base is None and (initial is None or h is None or steps is None):
        raise TypeError("the spec has no runs: initial, h and steps are needed")
    base = base or Run("run", (), Fraction(1), 1)
    changes: dict[str, Any] = {} if initial is None else {"initial": tuple(map(Fraction, _numbers(initial, "initial")))}
    if steps is not None:
        changes |= {"steps": arguments.count(steps, "steps", 1, limits.STEPS), "duration": None, "until": None}
    if parameters:
        changes["parameters"] = {**base.parameters, **_parameters(spec, parameters)}
    base = replace(base, **changes)
    base = base if h is None else with_step(base, Fraction(arguments.step_size(h)))
    if len(base.initial) != len(spec.coordinates) and not spec.lattice:
        raise ValueError(f"initial has {len(base.initial)} values for {len(spec.coordinates)} coordinates")
    return base


def _parameters(spec: Spec, parameters: Mapping[str, float]) -> dict[str, Fraction]:
    """Return the values in ``parameters``, which are the same for all members, as fractions.

    Raises `TypeError` or `ValueError` for wrong names or values, for instance for a value that violates the bound of a
    parameter.
    """
    arguments.expect_known(parameters, {p.name: 0.0 for p in spec.parameters})
    values = {name: arguments.number(value, f"parameter {name!r}") for name, value in parameters.items()}
    for p in spec.parameters:
        if p.refuses(values.get(p.name, 1.0)):
            raise ValueError(f"parameter {p.name!r} must be {p.bound}, not {values[p.name]}")
    return {name: Fraction(value) for name, value in values.items()}


def _numbers(sequence: Any, what: str) -> list[float]:
    """Return a number or an array as a list of finite numbers. ``what`` is its name in messages."""
    return arguments.array(sequence, what, (len(sequence),) if np.ndim(sequence) else (1,)).tolist()  # type: ignore[no-any-return]


def _sweep_of(
    spec: Spec,
    name: str | None,
    run: Run,
    over: Mapping[str, Any] | None,
    keep: Sequence[str] | None,
    frames: int | None,
) -> SweepSettings:
    if name is not None and name not in spec.sweeps:
        raise ValueError(f"there is no sweep {name!r}; the spec has {', '.join(spec.sweeps) or 'none'}")
    sweep = spec.sweeps[name] if name else next(iter(spec.sweeps.values()), None)
    if sweep is None and over is None:
        raise TypeError("the spec has no sweeps: over is needed")
    sweep = sweep or SweepSettings("sweep", run.name)
    changes: dict[str, Any] = {"run": run.name}
    if over is not None:
        words = _plain_entries(over, spec)
        axes = tuple(_axis(key, value, spec) for key, value in over.items() if key not in words)
        changes |= {"over": axes, "random": 0, "seed": 0, "file": "", **words}
    if isinstance(keep, str):
        raise TypeError(f"keep must be a list of names, [{keep!r}], not {keep!r}")
    changes |= {} if keep is None else {"keep": tuple(dict.fromkeys(keep))}
    changes |= {} if frames is None else {"frames": arguments.count(frames, "frames", 0)}
    sweep = replace(sweep, **changes)
    if end := end_of_its_own(sweep, run, monitored=spec.monitor is not None):
        raise ValueError(f"{end}; give the run steps instead")
    if obstacle := average_obstacle(sweep, run, monitored=spec.monitor is not None):
        raise ValueError("; ".join(obstacle))
    strange = [what for what in sweep.keep if what not in KEPT and Statistic.read(what, spec.recorded) is None]
    if strange:
        known = ", ".join([*KEPT, *spec.recorded, *(f"{of}({n})" for n in spec.recorded for of in STATISTICS)])
        raise ValueError(f"{strange[0]!r} cannot be kept; there are {known}")
    if "crossings" in sweep.keep and spec.lattice:
        raise ValueError("crossings: not available in sweeps of lattices; keep observables: M, mean(M), std(M)")
    if "crossings" in sweep.keep and run.section is None:
        raise ValueError(f"crossings: the run {run.name} has no section")
    if "energy_error" in sweep.keep and spec.time:
        raise ValueError("energy_error: H depends on the time, so energy is not conserved")
    drawn = [axis.name for axis in sweep.over if not axis.size]
    if drawn and not sweep.random and not any(axis.name == "seed" for axis in sweep.over):
        raise ValueError(
            f"over: {drawn[0]} has no count; add 'count', or draw values by 'random': 10 or by 'seed': {{'count': 10}}"
        )
    if sweep.random and len(drawn) < len(sweep.over):
        raise ValueError(
            "over: 'random' draws all values, but an entry has a count or a list; give only 'from' and 'to', "
            "or remove 'random'"
        )
    if sweep.file and (sweep.over or sweep.random):
        raise ValueError("over: a file holds all values; remove the other keys")
    if not (sweep.over or sweep.file):
        raise ValueError("over: there is nothing to vary")
    members = sweep.random or prod(axis.size for axis in sweep.over if axis.size)
    if members > limits.SWEPT:
        raise ValueError(f"over: {members} members, the limit is {limits.SWEPT}")
    return sweep


def _plain_entries(over: Mapping[str, Any], spec: Spec) -> dict[str, Any]:
    """Return the settings in the map ``over``: its entries ``random``, ``seed`` and ``file``. All other entries are
    ranges of quantities.

    If the spec has a parameter with one of these names, the entry is the range of the parameter, and is left out here.
    """
    if not isinstance(over, Mapping):
        raise TypeError(f"over must map names to ranges or lists, not {over!r}")
    parameters = {p.name for p in spec.parameters}
    words: dict[str, Any] = {}
    for key, least, most in (("random", 1, limits.SWEPT), ("seed", 0, limits.SWEEP_SEED)):
        if key in over and key not in parameters and not (key == "seed" and isinstance(over[key], Mapping)):
            words[key] = arguments.count(over[key], f"over: {key}", least, most)
    if "file" in over and "file" not in parameters:
        words["file"] = fspath(over["file"])
    return words


def _axis(name: str, value: Any, spec: Spec) -> Axis:
    known = [*(p.name for p in spec.parameters), *(() if spec.lattice else spec.coordinates), *SWEEP_NAMES]
    if name not in known:
        raise ValueError(f"over: {name!r} is not a parameter or a coordinate; there are {', '.join(known)}")
    if name == "start" and name not in known[: -len(SWEEP_NAMES)] and not spec.time:
        raise ValueError("over: start: this system does not depend on the time")
    numbers_draws = name == "seed" and name not in known[: -len(SWEEP_NAMES)]
    if isinstance(value, Mapping):
        return _draws(value) if numbers_draws else _range(name, value)
    values = _numbers(value, f"over: {name}") if np.ndim(value) else []
    if not values:
        raise ValueError(f"over: {name} must be a range, or a list of finite numbers")
    return Axis(name, tuple(values))


def _draws(value: Mapping[str, Any]) -> Axis:
    """Return the axis ``seed`` for a mapping {count: n}. Random values are drawn anew for each of its n values."""
    if set(value) != {"count"}:
        raise ValueError(f"over: seed must have the key count, and no other key, not {dict(value)!r}")
    return Axis("seed", count=arguments.count(value["count"], "over: seed: count", 1, limits.SWEPT))


def _range(name: str, value: Mapping[str, Any]) -> Axis:
    """Return the axis that a mapping {from: …, to: …, count: …, scale: …} describes. Raises `ValueError` if it is
    wrong.
    """
    for word in (*value, "from", "to"):
        if word not in ("from", "to", "count", "scale") or word not in value:
            raise ValueError(f"over: {name} needs from and to, and may have count and scale, not {dict(value)!r}")
    first, last = (arguments.number(value.get(end, 0), f"over: {name}: {end}") for end in ("from", "to"))
    count = arguments.count(value["count"], f"over: {name}: count", 1, limits.SWEPT) if "count" in value else 0
    scale = value.get("scale", "linear")
    if scale not in ("linear", "log"):
        raise ValueError(f"over: {name}: scale must be linear or log, not {scale!r}")
    if scale == "log" and min(first, last) <= 0:
        raise ValueError(f"over: {name} must be positive on a logarithmic scale, not {min(first, last):g}")
    return Axis(name, (), (first, last), count, scale)
