"""Computation of one chunk of members of a sweep: the runs, their results, and the entries in the store.

A worker process receives the path of the store and the number of the chunk. The store contains the solver and the
plan.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from math import prod
from typing import Any

import numpy as np

from phigen.runtime import cache
from phigen.runtime.interface import STATUSES, BackendError, Draws, Floats, LatticeInterface
from phigen.runtime.lattice import LatticeSolver
from phigen.runtime.members import Members
from phigen.runtime.solver import Solver
from phigen.sweeping import lattice_members
from phigen.sweeping.devices import own_device
from phigen.sweeping.statistics import MOST_BYTES, statistics_of
from phigen.sweeping.store import Job, open_job

#: Status of members that are not integrated because a parameter or an initial value is not allowed.
_REFUSED = STATUSES.index("BAD_ARGUMENT")


def make(store: str, digest: str, number: int) -> tuple[int, int]:
    """Compute the members of a chunk, store their results, and return the numbers of members and of failed members.

    ``digest`` identifies the content of the store. A process reads a store once, and again only if another store, with
    another digest, has replaced it.
    """
    job, solver = _ready(store, digest)
    plan = job.plan
    region = plan.region(number)
    varied = plan.varied(region, {name: job.root[name][region] for name in plan.listed})
    count = prod(part.stop - part.start for part in region)
    measured: Any = lattice_members.measured if isinstance(solver, LatticeSolver) else _measured
    results = measured(job, solver, varied, plan.first(region) + np.arange(count))
    results |= {axis.name: varied[axis.name] for axis in plan.drawn}
    sizes = tuple(part.stop - part.start for part in region)
    for name, values in results.items():
        if name != "status":
            job.root[name][region] = values.reshape(sizes + values.shape[1:])
    # The status is written last, so that a member with a status has all of its results.
    job.root["status"][region] = results["status"].reshape(sizes)
    return count, int(np.count_nonzero(results["status"]))


@lru_cache(maxsize=4)
def _ready(store: str, digest: str) -> tuple[Job, Solver | LatticeSolver]:
    """Return the opened store and its solver, which each process loads once.

    One process of a machine compiles the solver, while the other processes wait.
    """
    job = open_job(store)
    device = own_device(job.plan.about["target"])
    with _exclusive_lock(job.interface.name):
        if isinstance(job.interface, LatticeInterface):
            return job, LatticeSolver(job.backend(device), job.interface)
        return job, Solver(job.backend(device), job.interface)


@contextlib.contextmanager
def _exclusive_lock(name: str) -> Iterator[None]:
    """Return a context that only one process of this machine at a time can enter.

    Contexts with different names do not exclude each other.
    """
    try:
        import fcntl
    except ImportError:  # Windows has no fcntl: several processes may compile the solver at the same time
        yield
        return
    folder = cache.directory()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = os.open(folder / f"sweep-{name}.lock", os.O_CREAT | os.O_RDWR, 0o600)
    except OSError:
        yield
        return
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
    finally:
        os.close(lock)


def _measured(job: Job, solver: Solver, varied: Mapping[str, Floats], numbers: Any) -> dict[str, Floats]:
    """Return the results and the statuses of members, as arrays (members, …) by the name of the result.

    ``varied`` has the values of the varied quantities for the members. ``numbers`` are the numbers of the members in
    the sweep; each number selects a path of the noise.
    """
    plan, count = job.plan, len(numbers)
    # A value that all members have in common gets the shape (). Then the solver computes the coefficients of steps only
    # once.
    parameters = {name: varied.get(name, np.asarray(value)) for name, value in plan.parameters.items()}
    x0 = np.stack([varied.get(c, np.full(count, v)) for c, v in zip(plan.coordinates, plan.initial, strict=True)], 1)
    h, t0 = varied.get("step", np.asarray(plan.h)), varied.get("start", np.asarray(plan.t0))
    good = np.isfinite(x0).all(axis=1) & np.isfinite(h) & (h != 0) & np.isfinite(t0)
    for name, values in parameters.items():
        good &= np.isfinite(values) & ((values > 0) | (name not in solver.interface.positive))
    allowed = np.flatnonzero(good)
    asked = Members(x0, h, plan.steps, parameters, t0, plan.frames, Draws(plan.noise), numbers).part(allowed)
    states, failures = _integrated(solver, asked)
    status = np.full(count, _REFUSED, dtype=np.uint8)
    status[allowed] = 0
    for m, what in failures.items():
        status[allowed[m]] = STATUSES.index(what)
        states[-1, m] = np.nan
    results: dict[str, Any] = {"status": status}
    rows = np.concatenate([asked.x0[np.newaxis], states]) if not plan.frames else states
    if "final" in plan.keep:
        results["final"] = _spread(states[-1], allowed, count)
    if plan.frames:
        results["frames"] = _spread(np.moveaxis(states[: len(plan.rows)], 0, 1), allowed, count)
    if "energy_error" in plan.keep:
        with np.errstate(all="ignore"):  # failed members have states without a value
            energy = job.module.hamiltonian(rows, **asked.parameters)
            errors = np.abs(energy - energy[0]).max(axis=0)
        results["energy_error"] = _spread(errors, allowed, count)
    if "casimir_error" in plan.keep:
        with np.errstate(all="ignore"):
            casimirs = job.module.casimirs(rows, **asked.parameters)
            errors = np.abs(casimirs - casimirs[0]).max(axis=(0, -1), initial=0.0)
        results["casimir_error"] = _spread(errors, allowed, count)
    if "crossings" in plan.keep:
        results["crossings"] = _spread(_crossings(job, solver, asked), allowed, count)
    if "lyapunov" in plan.keep:
        results["lyapunov"] = _spread(_lyapunov(solver, asked, failures), allowed, count)
    if statistics := plan.statistics(solver.interface.observables):
        statistics_results = statistics_of(job, solver, asked, states, statistics)
        results |= {word: _spread(values, allowed, count) for word, values in statistics_results.items()}
    for name, values in results.items():
        if name not in ("status", "final", "frames"):
            values[status != 0] = np.nan
    return results


def _spread(values: Floats, allowed: Any, count: int) -> Floats:
    """Return an array for ``count`` members, with ``values`` at the indices ``allowed``, and NaN at all others."""
    spread = np.full((count, *values.shape[1:]), np.nan)
    spread[allowed] = values
    return spread


def _integrated(solver: Solver, members: Members) -> tuple[Floats, dict[int, str]]:
    """Integrate the members; return states (rows, members, DIM), and the statuses of failed members by index.

    The rows are the frames of the plan and the final states, or only the final states.
    """
    failures: dict[int, str] = {}
    try:
        states = solver.backend.ensemble(members, 1)
    except BackendError as error:
        states, failures = error.states, dict(error.failures)
    return states if members.stride else states[np.newaxis], failures


def _crossings(job: Job, solver: Solver, members: Members) -> Floats:
    """Return, for each member, how often it crosses the section in the direction that the run states."""
    section, time, signs = job.section()
    room = max(1, MOST_BYTES // (8 * members.x0.shape[1] * (members.steps + 1)))
    counts = np.zeros(len(members))
    for first in range(0, len(members), room):
        part = slice(first, first + room)
        some = replace(members.part(part), stride=1)
        states, _ = _integrated(solver, some)
        steps = np.arange(len(states))[:, np.newaxis]
        values = section(states, {**some.parameters, time: some.t0 + steps * some.h} if time else some.parameters)
        for sign in signs:
            along = sign * np.sign(some.h) * values
            rises = (along[:-1] < 0) & (along[1:] >= 0)
            # A start on the section counts as a crossing if the run then leaves it in the direction of the crossings.
            rises[:1] |= (along[:1] == 0) & (along[1:2] > 0)
            counts[part] += rises.sum(axis=0)
    return counts


def _lyapunov(solver: Solver, members: Members, failures: Mapping[int, str]) -> Floats:
    """Return the largest Lyapunov exponent of each member, from the tangent maps of its steps.

    The exponent of a member that failed is NaN.
    """
    from phigen.errors import StepError
    from phigen.study.lyapunov import spectrum

    exponents = np.full(len(members), np.nan)
    for m in range(len(members)):
        if m in failures:
            continue
        h, parameters, t0 = members.numbers(m)
        start = t0 if solver.interface.time else None
        drawn = {"seed": members.draws.seed, "member": int(members.paths[m])} if solver.interface.noise else {}
        with contextlib.suppress(StepError):
            exponents[m] = spectrum(solver, members.x0[m], h, members.steps, parameters, start, **drawn).largest
    return exponents
