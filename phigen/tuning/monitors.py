"""Search for a monitor for a spec without one.

A monitor is a positive function g of the state. Steps of equal size in the time τ, where dt = g dτ, are then shorter in
t where g is small.

Candidates are made from expressions in H that resemble distances: denominators, and arguments of roots and logarithms.
Further candidates are made from the state and from the speed |π∇H|. Another candidate is ``monitor: log``, which
requires that H splits into two parts. Runs without and with a monitor are compared over the same time, with the same
order and energy error. The gain of a monitor is the number of steps without it, divided by the number of steps with it.
The step size for the requested error is found by halving, and then by interpolation between two step sizes.
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
from phigen.tuning.problem import ROUNDING, ROWS, Problem
from phigen.tuning.scales import MOST_TURN, fastest_rate, motion
from phigen.tuning.settings import GAUSS, SPLITTING, Setting

#: Monitors are tried if the largest speed of the motion exceeds this multiple of the median speed.
UNEVEN = 3.0
#: The three constants limit the candidate monitors. MOST_BASES: candidates are built from at most this number of
#: expressions b in H, such as the square of a distance. QUARTERS: values of k, the most promising first, in the
#: candidates b^(k/4) and (1 + Σ 1/b)^(−k/4). OF_SPEED: values of k in the candidates (1 + v²/m)^(−k/4). Here v is the
#: speed |π∇H|, and m is the median of v² along the motion.
MOST_BASES, QUARTERS, OF_SPEED = 6, (3, 2, 4), (2, 1)
#: Largest number of characters of a monitor, so that users can read and modify it. A monitor with two distances in
#: space is shorter.
MOST_LETTERS = 160
#: HIGHEST: largest order at which monitors are compared. SECONDS: largest duration of a run in seconds. A run with a
#: monitor may have MOST · n steps. n is the number of steps without a monitor, but at least FEWEST.
HIGHEST, FEWEST, SECONDS = 6, 24, 2.0
#: Share of the time until the deadline that is reserved for runs. All builds are made before the runs.
MEASURING = 0.25
#: HALVINGS: largest number of halvings of a step size. MOST: a run with a monitor may have MOST times as many steps as
#: the run without a monitor.
HALVINGS, MOST = 30, 64


@dataclass(frozen=True)
class Trial:
    """Result for one monitor: the number of steps with which the energy error reaches the accuracy.

    Steps have equal size in τ, or in t without a monitor. ``steps`` is infinite if no step size reaches the accuracy.
    """

    setting: Setting
    label: str
    order: int
    step: float
    steps: float
    error: float
    seconds: float


@dataclass(frozen=True)
class Monitors:
    """Results of the search for a monitor, over a ``span`` of time.

    ``plain`` is the result without a monitor. ``found`` has the results with monitors. They are sorted by computing
    time, since steps of different schemes differ in cost. ``refused`` has the reasons why other monitors were not
    built.
    """

    span: float
    plain: Trial
    found: tuple[Trial, ...] = ()
    refused: Mapping[str, str] = field(default_factory=dict)

    def gain(self, trial: Trial) -> float:
        """Return the gain of a monitor: the number of steps without a monitor, divided by the number with this
        monitor.
        """
        return self.plain.steps / trial.steps


def is_uneven(rates: Callable[[Floats], Floats], states: Floats) -> bool:
    """Whether the speed of the motion varies so much that a monitor may help.

    ``rates`` is the vector field; ``states`` (rows, DIM) are states of the motion at equal distances in time.
    """
    speeds = np.linalg.norm(rates(states), axis=1)
    return bool(np.isfinite(speeds).all() and speeds.max() > UNEVEN * np.median(speeds))


def candidates(system: System, parameters: Mapping[str, float], states: Floats) -> Iterator[Expression]:
    """Yield candidate monitors: positive functions that are small where the motion is fast.

    ``states`` (rows, DIM) are states of the motion. Functions longer than `MOST_LETTERS` are left out.
    """
    return (g for g in _candidates(system, parameters, states) if _is_short(g))


def _is_short(monitor: Expression) -> bool:
    printed = str(monitor)  # a very long expression is cut, with an ellipsis
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
    """Yield (1 + Σ 1/b)^exponent. The sum is over the first n ``bases`` b, where n is as large as `MOST_LETTERS`
    allows.

    Nothing is yielded if fewer than two bases fit.
    """
    for count in range(len(bases), 1, -1):
        monitor = power(ONE + total(power(b, -1) for b in bases[:count]), number(exponent))
        if _is_short(monitor):
            yield monitor
            return


def _least_share(b: Expression, columns: Mapping[str, Floats | float]) -> float:
    """Return the smallest value of ``b`` along the motion, divided by the median of its values.

    The quotient is small for a distance that becomes small in close encounters. Expressions with small quotients are
    tried first.
    """
    (values,) = evaluate([b], columns)
    return float(np.min(values) / np.median(values))


def _bases(system: System) -> list[Expression]:
    """Return those expressions in H that depend on coordinates, and are denominators, or arguments of roots or
    logarithms.
    """
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
    """Whether the expression is a sum, such as x² + y²: then it is taken for the square of a distance."""
    return b.op in ("add", "sub")


def _is_positive(b: Expression, columns: Mapping[str, Floats | float]) -> bool:
    try:
        (values,) = evaluate([b], columns)
    except DomainError:
        return False
    return bool(np.all(np.isfinite(values)) and np.all(np.asarray(values) > 0))


def settings(current: Setting, order: int, monitors: Sequence[Expression]) -> list[Setting]:
    """Return the settings to build, all of the same order.

    The first setting has no monitor. The second is a splitting with ``monitor: log``. The others combine each of the
    ``monitors`` with the series and with Gauss collocation.
    """
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
    """Build the ``requested`` settings, and find for each the number of steps that reaches the accuracy.

    The first setting has no monitor; None is returned if it cannot be built. ``states`` (rows, DIM) are samples of the
    motion. ``span`` is the duration of the runs, ``deadline`` a value of `time.perf_counter`.
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
    """Return the result of a candidate: the fewest steps with an energy error of at most ``accuracy``.

    The step is halved until the error is small enough. Then a run is made with a step size between the last two, which
    is interpolated from their errors. If the error of this run is too large, the result of the last halving is
    returned.
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
    """Return the largest step that still resolves the fastest oscillation near some states of the motion."""
    moving = motion(solver.backend, problem.parameters, monitored=solver.interface.monitored)
    return MOST_TURN / max(fastest_rate(moving, states[:: max(1, len(states) // 64)]), 1e-300)


@dataclass(frozen=True)
class _Run:
    """Result of a run with one step size: largest energy error and processor time. If a step failed, the error is
    infinite.
    """

    h: float
    steps: float
    error: float
    seconds: float


def _run(solver: Solver, problem: Problem, span: float, h: float, max_steps: float) -> _Run:
    """Make a run of duration ``span`` with steps of size ``h``, and return its result.

    If the run needs more than ``max_steps`` steps or more than `SECONDS`, it is ended, and its error is infinite.
    """
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
