"""Tuning: the search for the cheapest method for one run of a spec, tests of the best methods in longer runs, and a
fair timing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import median

from phigen.compilation import Compilation
from phigen.compiler import compile_spec
from phigen.errors import SpecError
from phigen.geometry.conservation import Unit
from phigen.tuning import search
from phigen.tuning.monitors import Monitors, candidates, compare, is_uneven, settings
from phigen.tuning.problem import ROWS, Candidate, Problem, steps_in
from phigen.tuning.search import Curve
from phigen.tuning.settings import AUTO, Setting, own_setting
from phigen.tuning.timing import nanoseconds_per_step
from phigen.tuning.trials import Point
from phigen.tuning.tuner import Notify, TimeBudget, Tuner

#: The search measures methods in short runs, and proposes a step size for each. Then a longer run with this step size
#: confirms that the method reaches the accuracy. CONFIRMING: share of the time budget that the longer run should take.
#: PATIENCE: multiple of this share that the run may take at most. ATTEMPTS: number of step sizes that are tried for one
#: method.
CONFIRMING, PATIENCE, ATTEMPTS = 0.05, 4.0, 4
#: FINALISTS: number of best methods that are tested in longer runs and timed. BEHIND: largest cost of these methods, as
#: a multiple of the least cost. ROUNDS: number of rounds of timings.
FINALISTS, BEHIND, ROUNDS = 4, 2.0, 7
#: Multiple of the time budget after which no further method is confirmed by a longer run. If no method is confirmed at
#: that time, further methods get one longer run each, until a method is confirmed.
CONFIRMED = 1.0
#: Multiple of the time budget after which no further round of timings begins. A round takes about a tenth of the
#: budget.
TIMED = 1.1
#: Multiple of the time budget after which neither monitors nor ``scheme: auto`` are tried. It is larger than 1, so that
#: time remains for monitors even if the search has used up the whole budget.
MONITORED = 1.5
#: Costs that differ by less than this factor count as equal, and the simpler method is preferred.
EQUAL = 1.1


@dataclass(frozen=True)
class Finalist:
    """A method with a step size, measured in a run over the time ``point.time``.

    ``seconds`` are the processor times of the method in seconds per unit of simulated time, one for each round of
    timings.
    """

    curve: Curve
    point: Point
    seconds: tuple[float, ...] = ()

    @property
    def cost(self) -> float:
        """Median of the processor times, in seconds per unit of simulated time; NaN if the method was not timed."""
        return median(self.seconds) if self.seconds else math.nan


@dataclass(frozen=True)
class Tuning:
    """Result of a tuning. ``finalists`` are the best methods that reach the accuracy, the best first.

    ``own`` is the setting of the spec with the step that reaches the accuracy, None if no step does. ``present`` is the
    setting of the spec with the step of the run. ``peers`` are the classical methods that reach the accuracy.
    ``curves`` are the results of all methods over the time ``piece``, a part of the duration ``horizon``. ``refused``
    has the reasons why other candidates were not measured. ``finished`` says that all promising candidates were
    measured.

    ``measure`` is the measured error: energy or orbit. If it is energy, ``orbit_error`` is the orbit error of the best
    finalist over ``piece``, None if unknown. ``unit`` is the unit of energy errors. ``monitors`` has the gains of
    monitors, None if no monitor was tried. ``sizes`` are the sizes of the measured lattice, () for other systems. Times
    are values of the ``clock``, t or τ.
    """

    measure: str
    accuracy: float
    horizon: float
    piece: float
    curves: tuple[Curve, ...]
    finalists: tuple[Finalist, ...]
    own: Finalist | None
    present: Finalist | None
    peers: tuple[Finalist, ...] = ()
    refused: Mapping[Setting, str] = field(default_factory=dict)
    finished: bool = True
    orbit_error: float | None = None
    unit: Unit = field(default_factory=Unit)
    monitors: Monitors | None = None
    sizes: tuple[int, ...] = ()
    clock: str = "t"
    automatic: str = ""  # scheme that ``scheme: auto`` chooses at the order of the best method

    @property
    def automatic_ratio(self) -> float:
        """Cost of the best method with the scheme that ``scheme: auto`` chooses, relative to the least cost.

        The ratio is infinite if no method with this scheme reaches the accuracy.
        """
        costs = [c.cost(self.accuracy) for c in self.curves if c.setting and c.setting.scheme == self.automatic]
        best = min((c.cost(self.accuracy) for c in self.curves if c.setting), default=math.inf)
        return min(costs, default=math.inf) / best

    @property
    def winner(self) -> Finalist | None:
        """The best finalist, which is proposed to the user; None if no method reaches the accuracy."""
        return self.finalists[0] if self.finalists else None

    @property
    def closest(self) -> tuple[Curve, Point]:
        """Curve and point of the smallest error that was measured for a method of phigen."""
        measured_points = [(c, p) for c in self.curves for p in c.points if c.setting]
        return min(measured_points, key=lambda pair: pair[1].error)


def tune(
    compilation: Compilation, problem: Problem, measure: str, accuracy: float, budget: float | TimeBudget,
    note: Notify = lambda text: None,
) -> Tuning:  # fmt: skip
    """Measure candidate methods for a spec on a run, and find the cheapest one that reaches the accuracy.

    ``measure`` is ``energy``, the largest energy error along the run, or ``orbit``, the distance from a reference
    solution. The search takes about ``budget`` seconds; a `TimeBudget` may have begun before the call. ``note``
    receives messages on the progress. Raises `StepError` if the setting of the spec cannot make even small steps,
    `CheckError` if there is no reference solution, and `ToolchainError` if the C compiler fails.
    """
    clock = budget if isinstance(budget, TimeBudget) else TimeBudget(budget)
    tuner = Tuner(compilation, problem, accuracy, clock, note)
    current = tuner.start(measure)
    finished = tuner.search(current)
    classical = tuner.peers()
    finalists = final(tuner, current)
    current_run = _present(tuner, current)
    peers = [Finalist(c, p) for c in classical if clock.left(CONFIRMED) > 0 and (p := confirmed(tuner, c))]
    timed = time_all([*finalists, *peers, *([current_run] if current_run else [])], tuner)
    ranked, peers = ranking(timed[: len(finalists)]), timed[len(finalists) :][: len(peers)]
    look = ranked and measure == "energy"
    return Tuning(
        measure, accuracy, problem.horizon, tuner.piece, (*tuner.tried.values(), *classical), tuple(ranked),
        next((f for f in ranked if f.curve is current), None), timed[-1] if current_run else None, tuple(peers),
        {s: reason for s, reason in tuner.refused.items() if reason}, finished,
        tuner.orbit_error(ranked[0].curve, ranked[0].point.step) if look else None, problem.unit,
        monitored(tuner, current), problem.sizes, problem.clock,
        automatic(tuner.compilation, ranked) if clock.left(MONITORED) > 0 else "",
    )  # fmt: skip


def monitored(tuner: Tuner, current: Curve) -> Monitors | None:
    """Try monitors in runs over the time span of the search, and return the results.

    A monitor is useful if runs with it need fewer steps for the same energy error. The result is None if the spec has a
    monitor, if monitors do not apply, or if the speed of the motion varies little.
    """
    compilation, problem = tuner.compilation, tuner.problem
    spec, setting = compilation.spec, current.setting
    if spec.monitor is not None or not problem.evens_out or setting is None:
        return None
    h = min(p.step for p in current.points)
    states = tuner.methods[setting].rows(h, steps_in(tuner.piece, h), max(1, steps_in(tuner.piece, h) // ROWS))
    method = tuner.methods[setting]
    if states is None or not isinstance(method, Candidate):
        return None
    if not is_uneven(lambda x: method.solver.vector_field(x, problem.parameters), states):
        return None
    tuner.note("trying monitors")
    requested = settings(setting, current.order, list(candidates(compilation.system, problem.parameters, states)))
    deadline = tuner.clock.at(MONITORED)
    return compare(spec, compilation.system, requested, problem, states, tuner.piece, tuner.accuracy, deadline)


def automatic(compilation: Compilation, ranked: Sequence[Finalist]) -> str:
    """Return the scheme that ``scheme: auto`` chooses at the order of the best method in ``ranked``.

    The result is "" for a lattice, and if ``ranked`` is empty.
    """
    if not ranked or compilation.spec.lattice:
        return ""
    setting = replace(ranked[0].curve.setting or own_setting(compilation), kind=AUTO, composition="auto", gauge="auto")
    try:
        automatic_compilation = compile_spec(setting.applied(compilation.spec), system=compilation.known_system)
    except SpecError:
        return ""
    return automatic_compilation.scheme_name


def ranking(finalists: Sequence[Finalist]) -> list[Finalist]:
    """Return the finalists in the order of their cost, except that the first one is the simplest of the best.

    The best methods are those whose cost is at most `EQUAL` times the least cost. The simplest method has the smallest
    product of order and number of stages. Of two methods with equal products, the one without gauge is simpler.
    """
    ranked = sorted(finalists, key=lambda f: f.cost)
    equal = [f for f in ranked if f.cost <= EQUAL * ranked[0].cost]
    simple = min(equal, key=lambda f: (f.curve.order * max(f.curve.stages, 1), f.curve.gauged, f.cost), default=None)
    return [simple, *(f for f in ranked if f is not simple)] if simple else []


def final(tuner: Tuner, current: Curve) -> list[Finalist]:
    """Return the best methods and the method of the spec, each with a step size that a longer run has confirmed.

    ``current`` is the curve of the setting of the spec.
    """
    accuracy = tuner.accuracy
    finalists: list[Finalist] = []
    for curve in sorted(tuner.tried.values(), key=lambda c: c.cost(accuracy)):
        late = tuner.clock.left(CONFIRMED) < 0
        enough = len(finalists) >= FINALISTS or late
        behind = bool(finalists) and curve.cost(accuracy) > BEHIND * finalists[0].point.cost
        if math.isinf(curve.cost(accuracy)) or (finalists and (enough or behind) and (late or curve is not current)):
            continue
        point = confirmed(tuner, curve)
        if point:
            finalists.append(Finalist(curve, point))
    return finalists


def confirmed(tuner: Tuner, curve: Curve) -> Point | None:
    """Confirm the cheapest step size of a method by a longer run, and return the result of this run. The step size is
    rounded down before the run.

    The run extends over the horizon, or over as much of it as time allows. If the run misses the accuracy, a smaller
    step size is tried; at most `ATTEMPTS` step sizes are tried. The result is None if no step size reaches the
    accuracy, or if there is not enough time.
    """
    accuracy = tuner.accuracy
    method, measure = tuner.methods[curve.key], tuner.measures[curve.bounded]
    step, _ = search.cheapest_step(curve.points, search.AIM * accuracy, curve.order)
    step = step or search.cheapest_step(curve.points, accuracy, curve.order)[0]
    for attempt in range(ATTEMPTS):
        if not step or (attempt and tuner.clock.left(CONFIRMED) < 0):
            return None
        h = search.rounded_down(min(step, curve.largest))
        span = confirming_span(tuner, curve, h)
        if not span:
            return None
        point = measure(method, h, span)
        if point and point.error <= accuracy:
            return point
        gain = math.pow(search.AIM * accuracy / point.error, 1 / curve.order) if point else 0.0
        step = h * min(max(gain, 0.5), 0.95)
    return None


def confirming_span(tuner: Tuner, curve: Curve, h: float) -> float:
    """Return the duration of a run that confirms a step of size ``h``: the horizon, or as much as the budget allows.

    If orbits are measured, the duration is the time span of the reference solution. The result is 0 if even a run over
    the time span of the search would take too long.
    """
    seconds_per_step = 1e-9 * search.nanoseconds_at(curve.points, h)
    affordable = h * CONFIRMING * tuner.clock.budget / seconds_per_step
    if affordable * PATIENCE < tuner.piece:
        return 0.0
    return tuner.piece if tuner.referring else min(tuner.problem.horizon, max(affordable, tuner.piece))


def _present(tuner: Tuner, current: Curve) -> Finalist | None:
    """Measure the setting of the spec with the step of the run, and return the result. Returns None if the run fails,
    or if there is no time for the run.
    """
    h = tuner.problem.step
    span = confirming_span(tuner, current, h) if tuner.clock.left(CONFIRMED) > 0 else 0.0
    point = tuner.measures[current.bounded](tuner.methods[current.key], h, span) if span else None
    return Finalist(current, point) if point else None


def time_all(finalists: Sequence[Finalist], tuner: Tuner) -> list[Finalist]:
    """Return the methods with their times in several rounds, or in one if the budget is used up.

    In a round all methods are timed in turn, so that other load on the machine affects all of them.
    """
    seconds: list[list[float]] = [[] for _ in finalists]
    for completed in range(ROUNDS):
        if completed and tuner.clock.left(TIMED) < 0:
            break
        for finalist, rounds in zip(finalists, seconds, strict=True):
            h = finalist.point.step
            steps = steps_in(tuner.problem.horizon, h)
            rounds.append(1e-9 * nanoseconds_per_step(tuner.methods[finalist.curve.key], h, steps) / h)
    return [replace(f, seconds=tuple(rounds)) for f, rounds in zip(finalists, seconds, strict=True)]
