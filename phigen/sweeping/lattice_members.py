"""Members of sweeps of lattices: their initial states and parameters, their runs, and the results to store."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from phigen.lattice.states import Start, start_of
from phigen.memory import filled
from phigen.runtime.interface import STATUSES, BackendError, Draws, Floats, LatticeInterface, row_steps
from phigen.runtime.lattice import LatticeSession, LatticeSolver, reduced
from phigen.spec.model import Run, Spec, Statistic, Values
from phigen.study.averages import Averages
from phigen.sweeping.plan import Plan
from phigen.sweeping.store import Job

#: Processor time of a trial, in seconds, from which the time of a member is estimated.
_TRIAL = 0.3

#: Number of steps after which a tangent vector is normalised, so that it neither overflows nor underflows.
_CARRIED = 50

_REFUSED = STATUSES.index("BAD_ARGUMENT")


def begun(spec: Spec, run: Run, draw: int) -> Start:
    """Return the initial state and parameters of a member.

    ``draw`` is the value of the member along the axis ``seed``, or 0 if there is no such axis. The seeds of all random
    values of the run are increased by ``draw``.
    """
    if not draw or run.lattice is None:
        return start_of(spec, run)

    def moved(values: Values) -> Values:
        return replace(values, seed=values.seed + draw) if values.random else values

    state = {name: moved(values) for name, values in run.lattice.state.items()}
    arrays = {name: moved(values) for name, values in run.lattice.arrays.items()}
    parameters = tuple(replace(p, values=moved(p.values)) if p.values else p for p in spec.parameters)
    lattice = replace(run.lattice, state=state, arrays=arrays)
    return start_of(replace(spec, parameters=parameters), replace(run, lattice=lattice))


@lru_cache(maxsize=8)
def _spec_of(source: str, file: str) -> Spec:
    from phigen import spec as specs

    spec = specs.loads(source)
    return replace(spec, file=file) if file else spec


def _start(job: Job, draw: int) -> Start:
    about = job.plan.about
    spec = _spec_of(job.spec, about.get("file", ""))
    return begun(spec, spec.runs[about["run"]], draw)


def measured(job: Job, solver: LatticeSolver, varied: Mapping[str, Floats], numbers: Any) -> dict[str, Any]:
    """Return the results and the statuses of members, as arrays (members, …) by the name of the result.

    ``varied`` has the values of the varied quantities for the members. ``numbers`` are the numbers of the members in
    the sweep; each number selects a path of the noise.
    """
    plan, count, shape = job.plan, len(numbers), (len(job.plan.coordinates), *job.plan.sizes)
    results: dict[str, Any] = {"status": np.full(count, _REFUSED, dtype=np.uint8)}
    results |= {name: np.full(count, np.nan) for name in plan.keep if name != "final"}
    if "final" in plan.keep:
        results["final"] = filled(f"the states of {count} members", (count, *shape))
    if plan.frames:
        results["frames"] = filled(f"the frames of {count} members", (count, len(plan.rows), *shape))
    for m in range(count):
        member_values = {name: float(values[m]) for name, values in varied.items()}
        member = _Member(
            job.plan, solver, _start(job, int(member_values.pop("seed", 0))), member_values, int(numbers[m])
        )
        results["status"][m] = member.status
        for name, value in member.kept.items():
            results[name][m] = value
    return results


class _Member:
    """One member, whose run is made by the constructor: its ``status``, and its results if the status is 0
    (success)."""

    def __init__(
        self, plan: Plan, solver: LatticeSolver, start: Start, member_values: dict[str, float], number: int
    ) -> None:
        self.plan, self.solver, self.kept = plan, solver, dict[str, Any]()
        h, t0 = member_values.pop("step", plan.h), member_values.pop("start", plan.t0)
        self.status = _REFUSED
        if not (np.isfinite(h) and h != 0 and np.isfinite(t0)):
            return
        try:
            values = _values(plan, solver, start, member_values)
            draws = (Draws(plan.noise, number),) if solver.interface.noise else ()
            self.session = solver.backend.start(start.state, values, t0, *draws)
            self.status, results = 0, self._made(start.state, h, t0)
            if "lyapunov" in plan.keep:
                again = solver.backend.start(start.state, values, t0, *draws)
                results["lyapunov"] = exponent(again, h, plan.steps)
        except BackendError as error:
            self.status = STATUSES.index(error.status)
        except ValueError:  # a parameter or an initial value is not allowed
            self.status = _REFUSED
        else:
            self.kept = results

    def _made(self, state: Floats, h: float, t0: float) -> dict[str, Any]:
        plan, marks = self.plan, row_steps(self.plan.steps, self.plan.frames or max(1, self.plan.steps)).tolist()
        statistics = plan.statistics(self.solver.interface.observables)
        over_run = any(statistic.of for statistic in statistics.values())
        observed = (list(plan.rows) or row_steps(plan.steps, plan.stride).tolist()) if over_run else []
        averages = Averages(
            len(self.solver.interface.observables), after=plan.after, backwards=h < 0, blocks=plan.blocks
        )
        frames = filled("the frames of a member", (len(plan.rows), *state.shape))
        before, errors = self._conserved_values(), dict.fromkeys(("energy_error", "casimir_error"), 0.0)
        rows, rows_of_means = {mark: row for row, mark in enumerate(marks)}, set(observed)
        for mark in sorted({*marks, *observed}):
            self.session.advance(h, mark - self.session.steps)
            if mark in rows_of_means:
                averages.see(np.array([t0 + mark * h]), self.session.observables()[np.newaxis])
            if rows.get(mark, len(frames)) < len(frames):
                frames[rows[mark]] = self.session.state()
            for name, changes in self._changes(before).items() if mark in rows else ():
                errors[name] = max(errors[name], changes)
        results: dict[str, Any] = {name: error for name, error in errors.items() if name in plan.keep}
        results |= {"final": self.session.state()} if "final" in plan.keep else {}
        results |= self._statistics(statistics, averages)
        return results | ({"frames": frames} if plan.frames else {})

    def _statistics(self, statistics: Mapping[str, Statistic], averages: Averages) -> dict[str, float]:
        """Return the requested values of observables at the end of the run, by keyword, such as M or mean(M)."""
        if not statistics:
            return {}
        names = self.solver.interface.observables
        last, over_run = dict(zip(names, self.session.observables().tolist(), strict=True)), averages.results()
        results = dict(zip(names, over_run, strict=True))
        values = {
            "": last,
            "mean": {name: a.mean for name, a in results.items()},
            "std": {name: math.sqrt(a.variance) for name, a in results.items()},
            "error": {name: a.error for name, a in results.items()},
        }
        return {word: values[s.of][s.observable] for word, s in statistics.items()}

    def _conserved_values(self) -> tuple[float, list[Floats]]:
        """Return the energy and the Casimirs of the current state; no Casimirs if their errors are not requested."""
        kinds: LatticeInterface = self.solver.interface
        if "casimir_error" not in self.plan.keep:
            return self.session.hamiltonian(), []
        pairs = zip(kinds.casimir_kinds, self.session.casimirs(), strict=True)
        return self.session.hamiltonian(), [np.asarray(reduced(kind, densities)) for kind, densities in pairs]

    def _changes(self, before: tuple[float, list[Floats]]) -> dict[str, float]:
        """Return the change of the energy, and the largest change of a Casimir.

        ``before`` has the earlier values: the energy, and the Casimirs.
        """
        energy, casimirs = self._conserved_values()
        changes = [float(np.abs(a - b).max()) for a, b in zip(casimirs, before[1], strict=True)]
        return {"energy_error": abs(energy - before[0]), "casimir_error": max(changes, default=0.0)}


def _values(plan: Plan, solver: LatticeSolver, start: Start, member_values: Mapping[str, float]) -> dict[str, Any]:
    """Return the values of all parameters of a member. Raises `ValueError` for values that are not allowed."""
    numbers = {name: value for name, value in plan.parameters.items() if np.ndim(start.parameters[name]) == 0}
    return solver.values({**start.arguments, **numbers, **member_values}, {}, start.sizes)


def energies_at_start(
    job: Job, solver: LatticeSolver, varied: Mapping[str, Floats], count: int
) -> tuple[Floats, Floats]:
    """Return the initial energies of ``count`` members, and the sums over all sites of |energy of a site|.

    Both arrays have the shape (members,), and NaN for members whose values are not allowed. ``varied`` has the values
    of the varied quantities.
    """
    energies = np.full((2, count), np.nan)
    for m in range(count):
        member_values = {name: float(values[m]) for name, values in varied.items() if name != "step"}
        start, t0 = _start(job, int(member_values.pop("seed", 0))), member_values.pop("start", job.plan.t0)
        try:
            session = solver.backend.start(start.state, _values(job.plan, solver, start, member_values), t0)
        except (BackendError, ValueError):  # a parameter or an initial value is not allowed
            continue
        energies[:, m] = session.hamiltonian(), np.abs(session.density()).sum()
    return energies[0], energies[1]


def exponent(session: LatticeSession, h: float, steps: int) -> float:
    """Return the largest Lyapunov exponent of a run, from the growth of one tangent vector during all steps.

    ``session`` must be at the start of the run. Raises `BackendError` if a step fails.
    """
    vector, grown = np.random.default_rng(0).normal(size=(1, *session.state().shape)), 0.0
    vector = vector / np.linalg.norm(vector)
    for done in range(0, steps, _CARRIED):
        vector = session.advance_tangent(h, vector, min(_CARRIED, steps - done))
        size = float(np.linalg.norm(vector))
        grown += float(np.log(size))
        vector = vector / size
    return grown / (steps * abs(h))


def seconds_of_a_member(job: Job) -> float:
    """Return the estimated processor time of a member in seconds, from a trial of a part of its run."""
    plan, solver = job.plan, LatticeSolver(job.backend(), job.interface)  # type: ignore[arg-type]
    start = _start(job, 0)
    began, done, ahead = time.process_time(), 0, 1
    try:
        values = solver.values(start.arguments, {}, start.sizes)
        session = solver.backend.start(start.state, values, plan.t0)
        while done < plan.steps and time.process_time() - began < _TRIAL:
            session.advance(plan.h, ahead)
            done, ahead = done + ahead, 2 * ahead
    except (BackendError, ValueError):
        return 1.0  # an assumed time of a member, since the trial failed
    return (time.process_time() - began) / max(done, 1) * plan.steps + 1e-4
