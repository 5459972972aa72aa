"""Members of sweeps that are lattices: their starts and parameters, runs, and what is kept of them."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from phigen.lattice.states import Start, start_of
from phigen.runtime.interface import STATUSES, BackendError, Draws, Floats, LatticeInterface, row_steps
from phigen.runtime.lattice import LatticeSession, LatticeSolver, reduced
from phigen.runtime.memory import filled
from phigen.spec.model import Run, Spec, Values
from phigen.sweeping.plan import Plan
from phigen.sweeping.store import Job

#: Seconds of a trial.
_TRIAL = 0.3

#: Steps after which a vector that is carried along gets the length 1 again.
_CARRIED = 50

_REFUSED = STATUSES.index("BAD_ARGUMENT")


def begun(spec: Spec, run: Run, draw: int) -> Start:
    """What a member with that number of a draw starts from: what the run draws at random has so much larger a seed."""
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
    """What is kept of the members of these numbers, and their statuses. With noise, each has its own."""
    plan, count, shape = job.plan, len(numbers), (len(job.plan.coordinates), *job.plan.sizes)
    found: dict[str, Any] = {"status": np.full(count, _REFUSED, dtype=np.uint8)}
    found |= {name: np.full(count, np.nan) for name in plan.keep if name != "final"}
    if "final" in plan.keep:
        found["final"] = filled(f"the states of {count} members", (count, *shape))
    if plan.frames:
        found["frames"] = filled(f"the frames of {count} members", (count, len(plan.rows), *shape))
    for m in range(count):
        own = {name: float(values[m]) for name, values in varied.items()}
        member = _Member(job.plan, solver, _start(job, int(own.pop("seed", 0))), own, int(numbers[m]))
        found["status"][m] = member.status
        for name, value in member.kept.items():
            found[name][m] = value
    return found


class _Member:
    """One lattice, made: its status, and what is kept of it if that is 0."""

    def __init__(self, plan: Plan, solver: LatticeSolver, start: Start, own: dict[str, float], number: int) -> None:
        self.plan, self.solver, self.kept = plan, solver, dict[str, Any]()
        h, t0 = own.pop("step", plan.h), own.pop("start", plan.t0)
        numbers = {name: value for name, value in plan.parameters.items() if np.ndim(start.parameters[name]) == 0}
        given = {**start.arguments, **numbers, **own}
        self.status = _REFUSED
        if not (np.isfinite(h) and h != 0 and np.isfinite(t0)):
            return
        try:
            values = solver.values(given, {}, start.sizes)
            draws = (Draws(plan.noise, number),) if solver.interface.noise else ()
            self.session = solver.backend.start(start.state, values, t0, *draws)
            self.status, kept = 0, self._made(start.state, h)
            if "lyapunov" in plan.keep:
                again = solver.backend.start(start.state, values, t0, *draws)
                kept["lyapunov"] = exponent(again, h, plan.steps)
        except BackendError as error:
            self.status = STATUSES.index(error.status)
        except ValueError:  # numbers that are refused
            self.status = _REFUSED
        else:
            self.kept = kept

    def _made(self, state: Floats, h: float) -> dict[str, Any]:
        plan, marks = self.plan, row_steps(self.plan.steps, self.plan.frames or max(1, self.plan.steps))
        frames = filled("the frames of a member", (len(plan.rows), *state.shape))
        frames[:1] = state
        before, errors = self._seen(), dict.fromkeys(("energy_error", "casimir_error"), 0.0)
        for row, ahead in enumerate(np.diff(marks), 1):
            self.session.advance(h, int(ahead))
            if row < len(frames):
                frames[row] = self.session.state()
            for name, changes in self._changes(before).items():
                errors[name] = max(errors[name], changes)
        found: dict[str, Any] = {name: error for name, error in errors.items() if name in plan.keep}
        found |= {"final": self.session.state()} if "final" in plan.keep else {}
        return found | ({"frames": frames} if plan.frames else {})

    def _seen(self) -> tuple[float, list[Floats]]:
        """The energy, and the Casimirs."""
        kinds: LatticeInterface = self.solver.interface
        if "casimir_error" not in self.plan.keep:
            return self.session.hamiltonian(), []
        pairs = zip(kinds.casimir_kinds, self.session.casimirs(), strict=True)
        return self.session.hamiltonian(), [np.asarray(reduced(kind, densities)) for kind, densities in pairs]

    def _changes(self, before: tuple[float, list[Floats]]) -> dict[str, float]:
        """How far they are from what they were."""
        energy, casimirs = self._seen()
        changes = [float(np.abs(a - b).max()) for a, b in zip(casimirs, before[1], strict=True)]
        return {"energy_error": abs(energy - before[0]), "casimir_error": max(changes, default=0.0)}


def exponent(session: LatticeSession, h: float, steps: int) -> float:
    """The largest Lyapunov exponent, by a vector that the derivatives of all steps carry along.

    ``session`` stands at the start. Raises `BackendError`.
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
    """By a trial of a part of one."""
    plan, solver = job.plan, LatticeSolver(job.backend(), job.interface)  # type: ignore[arg-type]
    start = _start(job, 0)
    began, made, ahead = time.process_time(), 0, 1
    try:
        values = solver.values(start.arguments, {}, start.sizes)
        session = solver.backend.start(start.state, values, plan.t0)
        while made < plan.steps and time.process_time() - began < _TRIAL:
            session.advance(plan.h, ahead)
            made, ahead = made + ahead, 2 * ahead
    except (BackendError, ValueError):
        return 1.0  # nothing is known
    return (time.process_time() - began) / max(made, 1) * plan.steps + 1e-4
