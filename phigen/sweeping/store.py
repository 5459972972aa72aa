"""Store of a sweep: a Zarr group, which xarray opens as a Dataset.

The group contains an array for each result, in the chunks of the sweep, and the values along the dimensions. The array
``status`` is written last. So if the members of a chunk have a status, the chunk is complete. The attributes of the
subgroup ``made_by`` are the plan and the source of the solver.
"""

from __future__ import annotations

import builtins
import collections.abc
import hashlib
import json
import shutil
import uuid
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, is_dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np

from phigen import packages
from phigen.errors import FileError
from phigen.runtime.crossings import SIGNS
from phigen.runtime.interface import STATUSES, Floats, Interface, LatticeInterface
from phigen.sweeping.plan import Plan, values_of

#: Status of a member that has not been computed yet.
WAITING = 255

_SOLVER_DATA = "made_by"

#: Names that varied quantities must not have, since other arrays of the store have them.
OWN = ("status", "coordinate", "frame", "frames", _SOLVER_DATA)


def imported(name: str) -> Any:
    """Return the module of a package that sweeps need. Raises `MissingPackageError` if it is not installed."""
    return packages.imported(name, "sweeps", "dask distributed xarray zarr")


@dataclass(frozen=True)
class Job:
    """Opened store of a sweep, with all that a worker process needs to compute chunks.

    ``root`` is the Zarr group. ``interface`` and ``files`` belong to the solver. ``functions`` is the source of a NumPy
    module with energy, Casimirs and observables. ``spec`` is the text of the spec.
    """

    root: Any
    plan: Plan
    interface: Interface
    files: Mapping[str, str]
    functions: str
    spec: str

    def backend(self, device: int | None = None) -> Any:
        """Return the solver, compiled if necessary, and loaded.

        If the target runs on devices (graphics cards), ``device`` is the number of the device. Raises `ToolchainError`
        if the solver cannot be compiled.
        """
        from phigen import registry

        return registry.find(self.plan.about["target"]).load(self.files, self.interface, device)

    @cached_property
    def module(self) -> Any:
        """The NumPy module with functions of states: energy, Casimirs and observables."""
        from phigen.runtime.modules import load_module

        return load_module(self.functions, self.interface.name)

    def section(self) -> tuple[Callable[[Floats, Mapping[str, Floats]], Floats], str, tuple[float, ...]]:
        """Return the section of the run: a function that is 0 on it, the name of the time, and the signs of crossings.

        The function takes states (…, DIM), and the values of parameters and time by name. The sign 1 stands for rising
        crossings, the sign −1 for falling ones.
        """
        from phigen import spec as specs
        from phigen.symbolic.arrays import evaluate

        spec = specs.loads(self.spec)
        run = spec.runs[self.plan.about["run"]]
        expression = run.section
        assert expression is not None

        def g(x: Floats, more: Mapping[str, Floats]) -> Floats:
            values = {**more, **{c: x[..., i] for i, c in enumerate(spec.coordinates)}}
            return np.asarray(np.broadcast_to(evaluate([expression], values)[0], x.shape[:-1]))

        return g, spec.time, SIGNS[run.direction]


def digest_of(plan: Plan, solver: Mapping[str, Any]) -> str:
    """Return a hash of the solver, and of the plan without its division into chunks."""
    facts = {**plan.as_json(), "chunk": None}
    return hashlib.sha256(json.dumps([facts, solver], sort_keys=True).encode()).hexdigest()[:16]


def solver_data(interface: Interface, files: Mapping[str, str], functions: str, spec: str) -> dict[str, Any]:
    """Return the description of a solver that a store contains, as data for JSON.

    The description consists of the interface, the generated files, the NumPy module of functions of states, and the
    text of the spec.
    """
    about = {key: sorted(v) if isinstance(v, frozenset) else v for key, v in asdict(interface).items()}
    return json.loads(json.dumps({"interface": about, "files": dict(files), "functions": functions, "spec": spec}))  # type: ignore[no-any-return]


def create(path: Path, plan: Plan, solver: Mapping[str, Any], listed: Mapping[str, Floats]) -> bool:
    """Create a store without results. Return False if another process has created it in the meantime.

    The store is written under a temporary name and then renamed, so that an existing store is never incomplete. Raises
    `OSError` if it cannot be written.
    """
    temporary = path.with_name(f".phigen-{uuid.uuid4().hex}.zarr")
    try:
        _fill(temporary, plan, solver, listed)
        temporary.rename(path)
    except OSError:
        if path.is_dir():
            return False
        raise
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return True


def _fill(path: Path, plan: Plan, solver: Mapping[str, Any], listed: Mapping[str, Floats]) -> None:
    """Write a new store: its arrays, still without results, and the data that workers need."""
    zarr = imported("zarr")
    root = zarr.open_group(str(path), mode="w-", zarr_format=2)

    def array(name: str, dims: tuple[str, ...], kind: str, fill: Any, more: tuple[int, ...] = (), **about: Any) -> None:
        root.create_array(
            name, shape=plan.shape + more, chunks=plan.chunk + more, dtype=kind, fill_value=fill,
            attributes={"_ARRAY_DIMENSIONS": [*plan.dims, *dims], **about},
        )  # fmt: skip

    def along(name: str, values: Any) -> None:
        about = {"_ARRAY_DIMENSIONS": [name]}
        # The fill value must be None. Otherwise it is 0, and readers take each 0 for a missing value.
        root.create_array(name, data=np.asarray(values), fill_value=None, attributes=about)

    for axis in plan.grid if not plan.members else ():
        values = values_of(axis)
        along(axis.name, values.astype(np.int64) if axis.name == "seed" else values)
    for name, values in listed.items():
        about = {"_ARRAY_DIMENSIONS": ["member"]}
        root.create_array(name, data=values, chunks=plan.chunk, fill_value=None, attributes=about)
    for axis in plan.drawn:
        array(axis.name, (), "<f8", np.nan)
    for name in plan.keep:
        if name != "final":
            array(name, (), "<f8", np.nan)
    n, axes = len(plan.coordinates), tuple(solver["interface"].get("axes", ()))
    if "final" in plan.keep or plan.frames:
        along("coordinate", plan.coordinates)
    if "final" in plan.keep:
        array("final", ("coordinate", *axes), "<f8", np.nan, (n, *plan.sizes))
    if plan.frames:
        along("frame", np.array(plan.rows))
        array("frames", ("frame", "coordinate", *axes), "<f8", np.nan, (len(plan.rows), n, *plan.sizes))
    meanings = " ".join([*STATUSES, "WAITING"])
    flags = [*range(len(STATUSES)), WAITING]
    array("status", (), "u1", WAITING, flag_values=flags, flag_meanings=meanings)
    root.attrs.update({"system": solver["interface"]["name"], "steps": plan.steps, "h": plan.h, **plan.about})
    root.create_group(_SOLVER_DATA).attrs.update({"plan": plan.as_json(), **solver})


def open_job(path: str) -> Job:
    """Open a store for reading and writing. Raises `FileError` if the path is no store of a sweep."""
    zarr = imported("zarr")
    try:
        root = zarr.open_group(path, mode="r+")
        attributes = dict(root[_SOLVER_DATA].attrs)
        plan = Plan.from_json(attributes.pop("plan"))
    except (KeyError, ValueError, OSError, TypeError) as error:
        raise FileError(f"{path} is not a sweep of phigen: {error}") from None
    return Job(root, plan, interface_of(attributes.pop("interface")), **attributes)


def interface_of(about: Mapping[str, Any]) -> Interface:
    """Return the interface of a solver or of a lattice solver from the data in a store."""
    interface: Interface = _restored(LatticeInterface if "axes" in about else Interface, about)
    return interface


def _restored(kind: Any, value: Any) -> Any:
    """Return a value of the type ``kind`` (dataclass, tuple, set, mapping) from its data in JSON."""
    if is_dataclass(kind):
        hints = get_type_hints(kind)
        return kind(**{name: _restored(hints[name], each) for name, each in value.items()})  # type: ignore[operator]
    within = get_args(kind)
    match get_origin(kind):
        case builtins.tuple if len(within) == 2 and within[1] is ...:
            return tuple(_restored(within[0], each) for each in value)
        case builtins.tuple:
            return tuple(_restored(each_kind, each) for each_kind, each in zip(within, value, strict=True))
        case builtins.frozenset:
            return frozenset(value)
        case collections.abc.Mapping:
            return {key: _restored(within[1], each) for key, each in value.items()}
    return value


def waiting(job: Job) -> list[int]:
    """Return the numbers of the chunks of a store that have not been computed yet."""
    status, plan = job.root["status"], job.plan
    numbers = []
    for number in range(int(np.prod(plan.boxes))):
        region = plan.region(number)
        if status[tuple(slice(part.start, part.start + 1) for part in region)].item() == WAITING:
            numbers.append(number)
    return numbers
