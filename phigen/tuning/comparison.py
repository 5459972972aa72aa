"""Comparison of bi-realisations, schemes and classical methods on one run: cost, errors, and the Poisson
defect.

While `phigen.tuning.study.tune` searches for the cheapest setting, a comparison measures all settings, with the same
step size or at the same cost.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from phigen.compilation import Compilation
from phigen.errors import StepError
from phigen.runtime.solver import Solver
from phigen.study.methods import Method as Step
from phigen.study.methods import of_classical, of_solver
from phigen.symbolic.arrays import Floats
from phigen.tuning.building import Built, Outcome, build_all, built
from phigen.tuning.problem import Classical, CompiledMethod, Problem, steps_in
from phigen.tuning.references import orbit_error
from phigen.tuning.settings import Setting, own_setting
from phigen.tuning.timing import nanoseconds_per_step
from phigen.tuning.trials import MARKS, marks

#: Number of states at which the Poisson defect of a step is measured; the largest defect is reported.
STATES = 5
#: Approximate number of states of a run at which errors are measured.
ROWS = 2000
#: Classical methods of the comparison, with their names in tables.
PEERS = {"rk4": "RK4", "dop853": "DOP853"}
#: Shares of the time budget. BUILDING: for all builds. REFERRING: for the reference solution of one method.
BUILDING, REFERRING = 0.6, 0.05

Notify = Callable[[str], object]


@dataclass(frozen=True)
class ComparedMethod:
    """Results of one method of a comparison. If there are no results, ``refusal`` is the reason, else "".

    ``error`` and ``casimirs`` are the largest errors of energy and Casimirs along the run. ``orbit`` is the largest
    distance from the reference solution. ``defect`` is the residual of DΦ π DΦᵀ = π∘Φ. Unknown results are None.
    ``nanoseconds`` is the time of a step. ``poisson`` is true if a step is a Poisson map by construction. ``own`` is
    true for the method that the spec states.
    """

    title: str
    order: int
    step: float = math.nan
    steps: int = 0
    nanoseconds: float = math.nan
    error: float = math.nan
    casimirs: float | None = None
    orbit: float | None = None
    defect: float | None = None
    poisson: bool = False
    own: bool = False
    refusal: str = ""

    @property
    def seconds(self) -> float:
        """Processor time of the run in seconds."""
        return 1e-9 * self.nanoseconds * self.steps


@dataclass(frozen=True)
class Comparison:
    """Results of all methods on one run over the time ``horizon``.

    ``equal`` says what the methods have in common: ``step``, the step size, or ``work``, the processor time. ``unit``
    is the kind of the unit of energy errors (`Unit.kind`). ``clock`` is the variable in which steps have equal size, t
    or τ.
    """

    entries: tuple[ComparedMethod, ...]
    horizon: float
    equal: str
    unit: str
    clock: str


@dataclass(frozen=True)
class _Candidate:
    """A method to be measured: ``method`` makes its runs.

    ``step`` makes single steps, for the measurement of the Poisson defect; None if the defect is not measured.
    """

    title: str
    order: int
    method: CompiledMethod
    step: Step | None = None
    poisson: bool = False
    own: bool = False


def compare(
    compilation: Compilation,
    problem: Problem,
    orders: Sequence[int],
    *,
    equal: str = "step",
    budget: float = 60.0,
    note: Notify = lambda text: None,
) -> Comparison:
    """Measure methods on one run: the setting of the spec, all other settings of these ``orders``, RK4 and DOP853.

    ``compilation`` must have been made with tangent maps. If ``equal`` is ``work``, all methods take the same processor
    time: their step sizes are chosen so that each run costs as much as the run with the setting of the spec. The
    comparison takes about ``budget`` seconds. Raises `StepError` if the setting of the spec cannot make the run.
    """
    start = time.perf_counter()
    current = own_setting(compilation)
    current_build = built(compilation, current, start)
    candidates = [_of_build(current_build, problem, is_current=True)]
    settings = [s for s in dict.fromkeys(_settings(problem, current, orders)) if s != current]
    note(f"building {len(settings)} more")
    refused: list[ComparedMethod] = []
    fingerprints = {current_build.fingerprint}
    outcomes: dict[Setting, Outcome] = dict(
        build_all(compilation.spec, compilation.known_system, settings, start + BUILDING * budget)
    )
    for setting in settings:
        outcome = outcomes[setting]
        if not isinstance(outcome, Built):
            refused += (
                []
                if outcome.inapplicable
                else [ComparedMethod(setting.described(), setting.order, refusal=outcome.reason)]
            )
        elif outcome.fingerprint not in fingerprints:
            fingerprints.add(outcome.fingerprint)
            candidates.append(_of_build(outcome, problem))
    state = problem.start.copy()
    race = problem.classical(compilation, list(PEERS), state)
    peers = {name: Classical(race.runners[name], state, problem) for name in PEERS if name in race.runners}
    solver = candidates[0].step and Solver(current_build.solver(), current_build.interface)
    for name, method in peers.items():
        step = of_classical(name, solver, problem.parameters) if solver and problem.clock == "t" else None
        candidates.append(_Candidate(PEERS[name], {"rk4": 4, "dop853": 8}[name], method, step))
    seconds = REFERRING * budget
    first = _measured(candidates[0], problem, problem.step, peers.get("dop853"), seconds)
    if first.refusal:
        raise StepError(f"{problem.name}: {first.refusal}", step=0, status="NOT_FINITE")
    work = first.nanoseconds / first.step if equal == "work" else math.nan
    entries = [first]
    for candidate in candidates[1:]:
        note(candidate.title)
        h = problem.step
        if equal == "work":
            h = nanoseconds_per_step(candidate.method, h, steps_in(problem.horizon, h)) / work
        entries.append(_measured(candidate, problem, h, peers.get("dop853"), seconds))
    return Comparison((*entries, *refused), problem.horizon, equal, problem.unit.kind, problem.clock)


def _settings(problem: Problem, current: Setting, orders: Sequence[int]) -> list[Setting]:
    """Return the settings to compare: bi-realisations, splitting and Gauss, each at those of the ``orders`` that it
    offers."""
    families = dict.fromkeys([current.family, *(guess.family for guess in problem.guesses(current))])
    return [replace(family, order=order) for family in families for order in orders if order in family.orders]


def _of_build(build: Built, problem: Problem, *, is_current: bool = False) -> _Candidate:
    backend = build.solver()
    step = None if problem.sizes else of_solver(Solver(backend, build.interface), problem.parameters)
    title = build.setting.described(build.kind)
    return _Candidate(title, build.order, problem.method(backend), step, build.exact, is_current)


def _measured(
    candidate: _Candidate, problem: Problem, h: float, exact: CompiledMethod | None, seconds: float
) -> ComparedMethod:
    """Measure a method with a step size of about ``h`` over the whole run.

    ``exact`` is the method that computes the reference solution, None if there is no reference. The computation of the
    reference solution may take ``seconds``.
    """
    unmeasured = ComparedMethod(candidate.title, candidate.order, poisson=candidate.poisson, own=candidate.own)
    if not math.isfinite(h):
        return replace(unmeasured, refusal="a step cannot be made")
    steps = steps_in(problem.horizon, h)
    h = problem.horizon / steps
    states = candidate.method.rows(h, steps, max(1, steps // ROWS))
    if states is None:
        return replace(unmeasured, step=h, steps=steps, refusal=f"the run cannot be made with h = {h:.4g}")
    energies = problem.energies(states)
    stride, count = marks(problem.horizon, h)
    rows = candidate.method.rows(h, stride * count, stride) if exact is not None else None
    orbit = None
    if rows is not None and exact is not None and len(rows) > MARKS // 8:
        orbit = orbit_error(rows, stride * h, exact, problem.step, seconds)
    return replace(
        unmeasured,
        step=h,
        steps=steps,
        nanoseconds=nanoseconds_per_step(candidate.method, h, steps),
        error=float(np.max(problem.unit.errors(energies, float(energies[0])))),
        casimirs=problem.casimir_error(states),
        orbit=orbit,
        defect=_defect(candidate.step, problem, states, h),
    )


def _defect(step: Step | None, problem: Problem, states: Floats, h: float) -> float | None:
    """Return the largest Poisson defect of steps from `STATES` states of the run; None if ``step`` is None."""
    if step is None:
        return None
    sampled_states = states[np.linspace(0, len(states) - 1, STATES, dtype=int)]
    return problem.defect(step, sampled_states, h)
