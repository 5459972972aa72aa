"""Search for a monitor of a spec without one: candidates, and the number of steps of each for the same error.

Candidates are powers of the distances in denominators, roots and logarithms of H, powers of the speed |π∇H|, and
``log`` if H splits into two parts. The gain is the ratio of the numbers of steps over the same time, at the same order
and energy error; a step in τ is found by halving, and by interpolation with the order between two halves.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np

from phigen.geometry.system import System, hamiltonian_vector_field
from phigen.runtime.interface import BackendError
from phigen.runtime.solver import Solver
from phigen.spec.model import Spec
from phigen.spec.names import LOGARITHMIC
from phigen.symbolic.arrays import Floats, evaluate
from phigen.symbolic.expression import (
    ONE,
    Expression,
    gradient,
    number,
    power,
    symbol,
    symbols_of,
    topological,
    total,
)
from phigen.symbolic.numeric import DomainError
from phigen.tuning.building import Built, Refusal, build_all
from phigen.tuning.problem import ROWS, Problem
from phigen.tuning.scales import MOST_TURN, fastest_rate, motion
from phigen.tuning.settings import GAUSS, SPLITTING, Setting
from phigen.tuning.trials import ROUNDING

#: Ratio of the largest speed to the median above which monitors are tried.
UNEVEN = 3.0
#: Largest number of distances; exponents of their squares, in quarters, the most promising first; exponents of 1 + the
#: square of the speed.
MOST_BASES, QUARTERS, OF_SPEED = 6, (3, 2, 4), (2, 1)
#: Largest number of characters of a monitor, which a user can still read and modify: two distances in space.
MOST_LETTERS = 160
#: Largest order at which monitors are compared; least number of steps of a run, and its largest duration in seconds.
HIGHEST, FEWEST, SECONDS = 6, 24, 2.0
#: Share of the time that is reserved for runs after all builds.
MEASURING = 0.25
#: Largest number of halvings of a step; largest number of steps, in multiples of that without a monitor.
HALVINGS, MOST = 30, 64


@dataclass(frozen=True)
class Trial:
    """Number of steps in τ (in t without a monitor) with an energy ``error``; infinite if no number reaches the
    accuracy."""

    setting: Setting
    label: str
    order: int
    step: float
    steps: float
    error: float
    seconds: float


@dataclass(frozen=True)
class Monitors:
    """Gains of monitors over a ``span`` of time.

    They are the trial with steps equal in t, and those of all monitors, the fastest first. Steps of different schemes
    differ in cost.
    """

    span: float
    plain: Trial
    found: tuple[Trial, ...] = ()
    refused: Mapping[str, str] = field(default_factory=dict)

    def gain(self, trial: Trial) -> float:
        """Return the ratio of the numbers of steps without and with the monitor."""
        return self.plain.steps / trial.steps


def is_uneven(rates: Callable[[Floats], Floats], states: Floats) -> bool:
    """Whether the speed of the motion varies much. ``states`` (rows, DIM) are at equal distances in time."""
    speeds = np.linalg.norm(rates(states), axis=1)
    return bool(np.isfinite(speeds).all() and speeds.max() > UNEVEN * np.median(speeds))


def candidates(system: System, parameters: Mapping[str, float], states: Floats) -> Iterator[Expression]:
    """Yield candidate monitors: positive functions that are small in fast motion, not longer than `MOST_LETTERS`."""
    return (g for g in _candidates(system, parameters, states) if _is_short(g))


def _is_short(monitor: Expression) -> bool:
    printed = str(monitor)  # very long expressions are cut in this text
    return len(printed) <= MOST_LETTERS and "…" not in printed


def _candidates(system: System, parameters: Mapping[str, float], states: Floats) -> Iterator[Expression]:
    columns: dict[str, Floats | float] = {**parameters}
    columns |= {c: states[:, i] for i, c in enumerate(system.coordinates)}
    bases = [b for b in _bases(system) if _is_positive(b, columns)]
    bases = sorted(bases, key=lambda b: _least_share(b, columns))[:MOST_BASES]
    for k in QUARTERS:
        yield from _nearness(bases, Fraction(-k, 4))
        yield from (power(b, number(Fraction(k, 4))) for b in bases if _is_square(b))
    size = total(symbol(c) ** 2 for c in system.coordinates)
    yield power(ONE + size, number(Fraction(-1, 2)))
    rates = hamiltonian_vector_field(system.poisson, gradient(system.hamiltonian, system.coordinates))
    speed = total(f * f for f in rates)
    (speeds,) = evaluate([speed], columns)
    scale = float(np.median(np.broadcast_to(speeds, len(states))))
    if math.isfinite(scale) and scale > 0:
        distance = number(Fraction(f"{scale:.1e}"))
        yield from (power(ONE + speed / distance, number(Fraction(-k, 4))) for k in OF_SPEED)


def _nearness(bases: Sequence[Expression], exponent: Fraction) -> Iterator[Expression]:
    """Yield (1 + Σ 1/b)^exponent over as many of the first bases as fit in a line, unless fewer than two fit."""
    for count in range(len(bases), 1, -1):
        monitor = power(ONE + total(power(b, -1) for b in bases[:count]), number(exponent))
        if _is_short(monitor):
            yield monitor
            return


def _least_share(b: Expression, columns: Mapping[str, Floats | float]) -> float:
    """Return the smallest value divided by the median; it is smallest for the distances of close encounters."""
    (values,) = evaluate([b], columns)
    return float(np.min(values) / np.median(values))


def _bases(system: System) -> list[Expression]:
    """Return the coordinate-dependent expressions in denominators, under roots and in logarithms of H."""
    by_text: dict[str, Expression] = {}
    for node in topological([system.hamiltonian]):
        rooted = node.op == "pow" and (node.value < 0 or node.value != int(node.value))
        if (rooted or node.op == "log") and any(s in system.coordinates for s in symbols_of(node.args[0])):
            base = node.args[0]
            while base.op == "pow" and base.value > 0:
                base = base.args[0]
            by_text.setdefault(str(base), base)
    return list(by_text.values())


def _is_square(b: Expression) -> bool:
    """Whether the expression is a sum, and therefore the square of a distance rather than a distance."""
    return b.op in ("add", "sub")


def _is_positive(b: Expression, columns: Mapping[str, Floats | float]) -> bool:
    try:
        (values,) = evaluate([b], columns)
    except DomainError:
        return False
    return bool(np.all(np.isfinite(values)) and np.all(np.asarray(values) > 0))


def settings(current: Setting, order: int, monitors: Sequence[Expression]) -> list[Setting]:
    """Return the settings to build, of the same order: without a monitor, and each monitor with the series and with
    Gauss."""
    order = min(order + order % 2, HIGHEST)
    series = (
        Setting("auto", order, "none") if current.scheme != "series" else replace(current, order=order, gauge="none")
    )
    series = replace(series, composition="auto")
    explicit = Setting(SPLITTING, order, "none", "auto", monitor=LOGARITHMIC)
    gauss = Setting(GAUSS, order, "none")
    monitored = (replace(s, monitor=str(g)) for g in dict.fromkeys(monitors) for s in (series, gauss))
    return [series, explicit, *dict.fromkeys(monitored)]


def compare(
    spec: Spec,
    system: System,
    requested: Sequence[Setting],
    problem: Problem,
    states: Floats,
    span: float,
    accuracy: float,
    deadline: float,
) -> Monitors | None:
    """Return the trials of settings at the step sizes that reach the accuracy.

    The first setting has no monitor; None if it cannot be built. ``states`` (rows, DIM) are samples of the motion.
    """
    building = deadline - MEASURING * max(deadline - time.perf_counter(), 0.0)
    outcomes = dict(build_all(spec, system, requested, building))
    without_monitor, *monitors = requested
    plain_build = outcomes.get(without_monitor)
    if not isinstance(plain_build, Built):
        return None
    first = _trial(plain_build, problem, states, span, accuracy, span / problem.step, deadline)
    trials, refused = [], {}
    for setting in monitors:
        outcome = outcomes.get(setting)
        if isinstance(outcome, Built):
            trials.append(_trial(outcome, problem, states, span, accuracy, first.steps, deadline))
        elif isinstance(outcome, Refusal) and not outcome.inapplicable:
            refused[setting.monitor] = outcome.reason
    reached = [t for t in trials if math.isfinite(t.steps)]
    return Monitors(span, first, tuple(sorted(reached, key=lambda t: t.seconds)), refused)


def _trial(
    candidate: Built, problem: Problem, states: Floats, span: float, accuracy: float, max_steps: float, deadline: float
) -> Trial:
    """Return the trial with the fewest steps whose error is at most ``accuracy``.

    The step is halved until the error is small enough; the final step is interpolated by the order of the method.
    """
    solver = Solver(candidate.solver(), candidate.interface)
    h, previous = _largest(solver, problem, states), (math.nan, math.inf)
    for _ in range(HALVINGS):
        run = _run(solver, problem, span, h, MOST * max(max_steps, FEWEST))
        if run.error <= accuracy and math.isfinite(previous[1]):
            gained = math.log(previous[1] / accuracy) / math.log(previous[1] / max(run.error, ROUNDING))
            finer = previous[0] * math.pow(h / previous[0], min(1.02 * gained, 1.0))
            finer_run = _run(solver, problem, span, finer, math.inf)
            run = finer_run if finer_run.error <= accuracy else run
        if run.error <= accuracy:
            return Trial(candidate.setting, candidate.kind, candidate.order, run.h, run.steps, run.error, run.seconds)
        if run.seconds >= SECONDS or time.perf_counter() > deadline:
            break
        previous, h = (h, run.error), h / 2
    return Trial(candidate.setting, candidate.kind, candidate.order, math.nan, math.inf, math.inf, 0.0)


def _largest(solver: Solver, problem: Problem, states: Floats) -> float:
    """Return the largest step that resolves the fastest rotation of the motion."""
    moving = motion(solver.backend, problem.parameters, monitored=solver.interface.monitored)
    return MOST_TURN / max(fastest_rate(moving, states[:: max(1, len(states) // 64)]), 1e-300)


@dataclass(frozen=True)
class _Run:
    """A run with one step size: its largest energy error, inf if a step failed, and its CPU seconds."""

    h: float
    steps: float
    error: float
    seconds: float


def _run(solver: Solver, problem: Problem, span: float, h: float, max_steps: float) -> _Run:
    """Make a run to the end of the span; None if it needs more than ``max_steps`` steps or too much time."""
    started_at, states = time.thread_time(), [problem.start]
    session, steps_done, time_passed = solver.backend.start(problem.start, problem.parameters), 0, 0.0
    try:
        while time_passed < span:
            block = 1 + steps_done // ROWS if solver.interface.monitored else max(1, int(span / h / ROWS))
            session.advance(problem.direction * h, block)
            steps_done += block
            time_passed = abs(session.time()) if solver.interface.monitored else steps_done * h
            states.append(session.state())
            if steps_done > max_steps or time.thread_time() - started_at > SECONDS:
                return _Run(h, math.inf, math.inf, SECONDS)
    except BackendError:
        return _Run(h, 0, math.inf, time.thread_time() - started_at)
    seconds, energies = time.thread_time() - started_at, problem.energies(np.array(states))
    error = float(np.max(problem.unit.errors(energies, float(energies[0]))))
    return _Run(h, steps_done * span / time_passed, error if math.isfinite(error) else math.inf, seconds)
