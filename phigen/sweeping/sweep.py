"""Computation of a sweep: creation or continuation of the store, and computation of all missing chunks."""

from __future__ import annotations

import csv
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from hashlib import sha256
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from phigen._version import __version__
from phigen.api import chosen_target, compilation_of, files_of, interface_of
from phigen.compilation import Compilation
from phigen.compiler import emit
from phigen.errors import DeviceError, Diagnostic, FileError, MissingPackageError, SpecError
from phigen.geometry.conservation import LARGE_ENERGY_ERROR
from phigen.memory import expect_room
from phigen.reading import opened_text
from phigen.runtime.interface import BackendError, Draws, Floats
from phigen.runtime.members import Members
from phigen.spec.model import Run, Spec, SweepSettings
from phigen.spec.names import KEPT
from phigen.spec.problems import counted, did_you_mean
from phigen.sweeping import cluster, lattice_members, store
from phigen.sweeping.devices import workers_of
from phigen.sweeping.differences import differences
from phigen.sweeping.plan import Plan, chunk_of
from phigen.sweeping.quality import EnergyErrors, energy_errors, lattice_energy_errors

#: Intended processor time of a chunk in seconds: long compared with scheduling and storing, short for a waiting user.
_SECONDS = 4.0

#: For Lyapunov exponents: assumed time of a step with its tangent map, in seconds. It is long, since Python processes
#: the tangent maps.
_TANGENT = 40e-6

#: Smallest and largest number of members of a chunk.
_LEAST, _MOST = 32, 1 << 17


@dataclass(frozen=True)
class SweepSetting:
    """Options for the computation of a sweep: the store ``output``, the workers, and options of the solver.

    If ``target`` is None, the target that the spec states for the sweep is used.
    """

    output: Path
    scheduler: str | None = None
    workers: int | None = None
    target: str | None = None
    order: int | None = None
    scheme: str | None = None
    profile: str | None = None


@dataclass(frozen=True)
class Outcome:
    """Result of a call that computes a sweep.

    ``members`` is the number of members that this call has computed, ``failed`` the number of those that failed. The
    other fields describe the whole sweep. ``size`` is the number of its members, and ``dims`` has the sizes of its
    dimensions. ``energy`` describes the members with large energy errors.
    """

    members: int
    failed: int
    size: int
    dims: Mapping[str, int]
    order: int
    energy: EnergyErrors


def made(
    spec: Spec,
    sweep: SweepSettings,
    run: Run,
    setting: SweepSetting,
    started: Callable[[int], None],
    tell: cluster.Tell,
) -> Outcome:
    """Compute the members of a sweep that its store does not contain yet.

    ``started`` receives the number of members to compute. After each chunk, ``tell`` receives the numbers of computed
    and of failed members. Raises `SpecError`; `FileError` if the store contains another sweep; `LimitError` if the
    chunks that are computed at the same time do not fit into memory; and `SweepError` if the computation stops.
    """
    store.imported("zarr")
    target = chosen_target(setting.target or sweep.target)
    # If workers run on this machine, a target whose device is missing is refused here, before anything is compiled.
    default = 0 if setting.scheduler else _workers(target, spec, sweep, setting)
    workers = setting.workers or default
    compilation = compilation_of(
        _with_ensembles(spec),
        order=setting.order,
        scheme=setting.scheme,
        profile=setting.profile,
        tangent="lyapunov" in sweep.keep,
    )
    listed = _member_columns(sweep, spec) if sweep.file else {}
    _expect_names([*(axis.name for axis in sweep.over), *listed], spec, sweep)
    plan = _plan(spec, sweep, run, {name: len(values) for name, values in listed.items()}, target)
    _expect_room_for_axes(sweep, spec)
    solver = _solver_data(compilation, target, spec)
    counts = np.zeros(2, dtype=np.int64)

    def count(members: int, failed: int) -> None:
        counts[:] += members, failed
        tell(members, failed)

    job = _gone_on_with(setting.output, plan, solver, spec, listed) if setting.output.exists() else None
    if job is None or store.waiting(job):
        with cluster.connected(setting.scheduler, workers) as (client, slots):
            job = job or _created(setting.output, plan, solver, spec, listed, slots)
            chunks = store.waiting(job)
            if setting.scheduler is None:  # only for workers on this machine, whose memory is known
                running, held = min(slots, len(chunks)), prod(job.plan.chunk) * job.plan.bytes_of_member
                expect_room(f"{running} chunks of a sweep at a time", running * held)
            started(sum(_members_of(job.plan, number) for number in chunks))
            place = str(setting.output.resolve()), store.digest_of(job.plan, solver)
            cluster.make_all(client, slots, *place, chunks, count)
        store.imported("zarr").consolidate_metadata(str(setting.output))
    dims = dict(zip(plan.dims, plan.shape, strict=True))
    if spec.lattice:
        energy = lattice_energy_errors(job, compilation.by_sweeps().cell, LARGE_ENERGY_ERROR)
    else:
        energy = energy_errors(job, compilation.system, LARGE_ENERGY_ERROR)
    return Outcome(int(counts[0]), int(counts[1]), plan.size, dims, compilation.order.order, energy)


def _workers(target: str, spec: Spec, sweep: SweepSettings, setting: SweepSetting) -> int:
    """Return the default number of workers on this machine.

    Raises `DeviceError` or `MissingPackageError` if the target needs a device that this machine lacks.
    """
    try:
        return workers_of(target)
    except (DeviceError, MissingPackageError) as error:
        if setting.target is not None:
            raise
        place = spec.diagnostic(("sweeps", sweep.name, "target"), "").location
        raise type(error)(f"{place}: {error}\n  hint: choose another target by -t") from error


def _expect_names(varied: Iterable[str], spec: Spec, sweep: SweepSettings) -> None:
    """Raise `SpecError` if a varied quantity has the name of another array of the store, such as ``status``."""
    for name in varied:
        if name in (*store.OWN, *KEPT, *sweep.stored):
            message = f"{spec.file}: {name!r} is also the name of another array in the store of the sweep"
            raise SpecError([Diagnostic(message, hint="choose another name for it in the spec")])


def _with_ensembles(spec: Spec) -> Spec:
    """Return a spec for which the code for ensembles is generated, even if the key ``without:`` leaves this code out.
    Sweeps need the code.
    """
    return replace(spec, extras=replace(spec.extras, without=spec.extras.without - {"ensemble", "members"}))


def _expect_room_for_axes(sweep: SweepSettings, spec: Spec) -> None:
    """Raise `LimitError` if two arrays with the values along a dimension do not fit into memory."""
    for axis in sweep.over:
        place = spec.diagnostic(("sweeps", sweep.name, "over", axis.name), "").location
        expect_room(f"{axis.size} values of {axis.name}", 2 * 8 * axis.size, place, "random members have no axes")


def _members_of(plan: Plan, number: int) -> int:
    return int(np.prod([part.stop - part.start for part in plan.region(number)]))


def _plan(spec: Spec, sweep: SweepSettings, run: Run, columns: Mapping[str, int], target: str) -> Plan:
    """Return the plan of a sweep, before its division into chunks is chosen.

    ``columns`` are the names of the columns of a file of members, with their lengths.
    """
    return Plan(
        name=sweep.name,
        coordinates=spec.coordinates,
        initial=tuple(float(v) for v in run.initial),
        h=float(run.step),
        t0=float(run.start),
        parameters=spec.parameters_of(run),
        steps=run.steps,
        axes=sweep.over,
        seed=sweep.seed,
        noise=(run.seed + sweep.seed) % 2**64,
        members=sweep.random or next(iter(columns.values()), 0),
        listed=tuple(columns),
        keep=sweep.stored,
        frames=sweep.frames,
        after=None if run.average.after is None else float(run.average.after),
        blocks=run.average.blocks,
        stride=run.stride,
        sizes=lattice_members.begun(spec, run, 0).sizes if spec.lattice else (),
        about={"sweep": sweep.name, "run": run.name, "target": target, "phigen": __version__, **_files(spec, run)},
    )


def _files(spec: Spec, run: Run) -> dict[str, Any]:
    """Return data for JSON: the path of the spec file, and a digest of each data file that a run of a lattice
    reads.

    If the run reads no data files, the result is {}.
    """
    if run.lattice is None:
        return {}
    values = [*run.lattice.state.values(), *run.lattice.arrays.values(), *(p.values for p in spec.parameters)]
    names = {v.file for v in values if v and v.file}
    if isinstance(run.lattice.bonds, str) and run.lattice.bonds:
        names.add(run.lattice.bonds)
    if not names:
        return {}
    path = Path(spec.file).resolve()
    digests = {name: sha256((path.parent / name).read_bytes()).hexdigest() for name in sorted(names)}
    return {"file": str(path), "contents": digests}


def _solver_data(compilation: Compilation, target: str, spec: Spec) -> dict[str, Any]:
    """Return the data from which workers load the solver. `store.solver_data` describes these data."""
    program, command = compilation.program, f"phigen build {compilation.program.name}.yaml"
    (functions,) = emit(program, "numpy", command).values()
    return store.solver_data(interface_of(program), files_of(program, target, command), functions, spec.source)


def _gone_on_with(
    output: Path, plan: Plan, solver: Mapping[str, Any], spec: Spec, listed: Mapping[str, Floats]
) -> store.Job:
    """Open the existing store ``output``, to continue the sweep in it. Raises `FileError` if the store contains another
    sweep.
    """
    job = store.open_job(str(output))
    if phrases := differences(job, plan, solver, spec, listed):
        message = f"{output} holds another sweep: {'; '.join(phrases)}"
        raise FileError(f"{message}\n  hint: choose another name by -o, or remove the store")
    return job


def _created(
    output: Path, plan: Plan, solver: Mapping[str, Any], spec: Spec, listed: Mapping[str, Floats], slots: int
) -> store.Job:
    """Create the store ``output``, and return it opened.

    The chunks are small enough to keep all threads of the workers busy; ``slots`` is the number of these threads. If
    another process has created this store in the meantime, the store of the other process is returned.
    """
    job = store.Job(
        None, plan, store.interface_of(solver["interface"]), solver["files"], solver["functions"], solver["spec"]
    )
    seconds = _seconds_of_a_member(job)
    least = 1 if plan.sizes else _LEAST
    members = int(min(max(_SECONDS / seconds, least), _MOST, max(least, plan.size // (4 * slots))))
    if store.create(output, replace(plan, chunk=chunk_of(plan, members)), solver, listed):
        return store.open_job(str(output))
    return _gone_on_with(output, plan, solver, spec, listed)


def _seconds_of_a_member(job: store.Job) -> float:
    """Return the estimated processor time of a member in seconds, from a trial of a few members and steps.

    The solver is compiled if it is not in the cache.
    """
    if job.plan.sizes:
        return lattice_members.seconds_of_a_member(job)
    plan, steps = job.plan, min(job.plan.steps, 2000)
    values = {name: np.asarray(value) for name, value in plan.parameters.items()}
    x0 = np.array([plan.initial] * 64)
    h, t0 = np.asarray(plan.h), np.asarray(plan.t0)
    trial = Members(x0, h, steps, values, t0, draws=Draws(plan.noise), paths=np.arange(len(x0)))
    backend = job.backend()
    began = time.process_time()  # processor time, so that other load on the machine does not lead to smaller chunks
    try:
        backend.ensemble(trial, 1)
    except BackendError:
        return _SECONDS / 4096  # an assumed time of a member, since the trial failed
    seconds = (time.process_time() - began) / len(x0) * (plan.steps / steps) + 1e-7
    counted = ("crossings" in plan.keep) + any("(" in word for word in plan.keep)
    return seconds * (1 + counted) + ("lyapunov" in plan.keep) * _TANGENT * plan.steps


def _member_columns(sweep: SweepSettings, spec: Spec) -> dict[str, Floats]:
    """Return the columns of the CSV file of members, by name, (members,) each.

    Raises `SpecError`, located at the name of the file in the spec, if the file cannot be read or has wrong columns.
    """
    path = Path(spec.file).parent / sweep.file

    def refused(why: str, hint: str = "") -> SpecError:
        place = ("sweeps", sweep.name, "over", "file")
        return SpecError([spec.diagnostic(place, f"file: cannot read {str(path)!r}: {why}", hint)])

    try:
        with opened_text(path) as file:
            reader = csv.reader(file)
            (_, names), *rows = [(reader.line_num, row) for row in reader if row] or [(0, [])]
    except OSError as error:
        raise refused(error.strerror or str(error)) from None
    except (ValueError, csv.Error) as error:
        raise refused(f"expected a line of names, and lines of numbers: {error}") from None
    values = np.empty((len(rows), len(names)))
    for member, (line, row) in enumerate(rows):
        if len(row) != len(names):
            raise refused(f"line {line} has {counted(len(row), 'number')}, but there are {counted(len(names), 'name')}")
        try:
            values[member] = [float(entry) for entry in row]
        except ValueError as error:
            raise refused(f"line {line}: {error}", "columns have commas between them, and decimals a point") from None
    names = [name.strip() for name in names]
    known = {*(spec.coordinates if not spec.lattice else ()), *(p.name for p in spec.parameters), "step"}
    known |= {"start"} if spec.time else set()
    strange = [name for name in names if name not in known]
    if strange:
        raise refused(f"{strange[0]!r} is not a parameter or a coordinate", did_you_mean(strange[0], known))
    if len(set(names)) < len(names):
        raise refused("two columns have the same name")
    if not rows:
        raise refused("it has no members")
    return {name: np.ascontiguousarray(values[:, k]) for k, name in enumerate(names)}
