"""Tuning of one run of a spec: search, confirmation, comparison."""

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

#: Share of the budget for one confirming run, factor by which it may be exceeded, and number of attempts at a step.
CONFIRMING, PATIENCE, ATTEMPTS = 0.05, 4.0, 4
#: Number of finalists, their largest cost relative to the best, and number of rounds of timings.
FINALISTS, BEHIND, ROUNDS = 4, 2.0, 7
#: Share of the budget after which only settings that the result needs are confirmed.
CONFIRMED = 1.0
#: Share of the budget after which methods are timed only once; a round of timings takes some tenth of it.
TIMED = 1.1
#: Share of the budget, counted from its start, after which no monitor and no automatic scheme is tried. Monitors have
#: half of the budget if the search used up all of it.
MONITORED = 1.5
#: Factor within which costs count as equal; the lower order is then preferred.
EQUAL = 1.1


@dataclass(frozen=True)
class Finalist:
    """A method at its proposed step, confirmed over ``point.time``, and timed in rounds with the others.

    ``seconds`` are CPU times (s) per unit of simulated time, one for each round.
    """

    curve: Curve
    point: Point
    seconds: tuple[float, ...] = ()

    @property
    def cost(self) -> float:
        """Median over the rounds of the CPU time (s) per unit of simulated time; NaN if the method was not timed."""
        return median(self.seconds) if self.seconds else math.nan


@dataclass(frozen=True)
class Tuning:
    """The result of a tuning. ``finalists`` meet the accuracy, the best first; empty if no method does.

    ``own`` is the setting of the spec at the step that reaches the accuracy, None if no step does. ``present`` is the
    setting of the spec at the step of the run. ``peers`` are the classical methods that reach the accuracy. Scans were
    made over ``piece`` of the ``horizon``. ``refused`` has the reasons why other candidates were not measured.
    ``finished`` says whether all promising candidates were measured. ``orbit_error`` is the error of the orbit of the
    best finalist over ``piece`` if the energy error was measured, None if it is unknown. ``unit`` is the unit of energy
    errors. ``monitors`` are the gains of monitors, if the spec has none and the speed of the motion varies much.
    ``sizes`` are the sizes of the measured lattice, empty for other systems. Times are values of the ``clock``, t or τ.
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
    automatic: str = ""  # the scheme that ``scheme: auto`` chooses at the order of the proposal

    @property
    def automatic_ratio(self) -> float:
        """Cost of the best method of the automatic scheme relative to the proposal; infinite if none reaches the
        accuracy."""
        costs = [c.cost(self.accuracy) for c in self.curves if c.setting and c.setting.scheme == self.automatic]
        best = min((c.cost(self.accuracy) for c in self.curves if c.setting), default=math.inf)
        return min(costs, default=math.inf) / best

    @property
    def winner(self) -> Finalist | None:
        """The proposed method: the best finalist, None if there is none."""
        return self.finalists[0] if self.finalists else None

    @property
    def closest(self) -> tuple[Curve, Point]:
        """Return the curve and the point with the smallest measured error."""
        measured_points = [(c, p) for c in self.curves for p in c.points if c.setting]
        return min(measured_points, key=lambda pair: pair[1].error)


def tune(
    compilation: Compilation, problem: Problem, measure: str, accuracy: float, budget: float | TimeBudget,
    note: Notify = lambda text: None,
) -> Tuning:  # fmt: skip
    """Measure the candidates of a spec on a run, and find the cheapest that meets the accuracy.

    ``measure`` is ``energy``, the largest error of the energy along the run, or ``orbit``, the distance from a
    reference. It takes at most about ``budget`` seconds; a `TimeBudget` may have begun before. Raises `StepError` if
    the setting of the spec cannot make even small steps, `CheckError` if there is no reference, `ToolchainError`
    without a C compiler.
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
    """Return the gains of monitors over the time of a scan; None if the speed of the motion varies little."""
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
    """Return the scheme that ``scheme: auto`` chooses at the order of the best; "" for a lattice, and if there is no
    best."""
    if not ranked or compilation.spec.lattice:
        return ""
    setting = replace(ranked[0].curve.setting or own_setting(compilation), kind=AUTO, composition="auto", gauge="auto")
    try:
        automatic_compilation = compile_spec(setting.applied(compilation.spec), system=compilation.known_system)
    except SpecError:
        return ""
    return automatic_compilation.scheme_name


def ranking(finalists: Sequence[Finalist]) -> list[Finalist]:
    """Return finalists by cost.

    Among those with about the cost of the best, the lowest order comes first, and then settings without a gauge.
    """
    ranked = sorted(finalists, key=lambda f: f.cost)
    equal = [f for f in ranked if f.cost <= EQUAL * ranked[0].cost]
    simple = min(equal, key=lambda f: (f.curve.order * max(f.curve.stages, 1), f.curve.gauged, f.cost), default=None)
    return [simple, *(f for f in ranked if f is not simple)] if simple else []


def final(tuner: Tuner, current: Curve) -> list[Finalist]:
    """Return the best candidates and the setting of the spec, each at a step that a longer run confirmed."""
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
    """Measure the cheapest step, rounded to few digits, over the horizon, or as much of it as there is time for.

    A step that misses the accuracy is reduced a few times; None if no step reaches the accuracy.
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
    """Return the time span of a confirming run: the horizon, or as much as its share of the budget allows.

    Orbits are measured over the time span of their reference. 0 if even the time span of a scan would take too long.
    """
    seconds_per_step = 1e-9 * search.nanoseconds_at(curve.points, h)
    affordable = h * CONFIRMING * tuner.clock.budget / seconds_per_step
    if affordable * PATIENCE < tuner.piece:
        return 0.0
    return tuner.piece if tuner.referring else min(tuner.problem.horizon, max(affordable, tuner.piece))


def _present(tuner: Tuner, current: Curve) -> Finalist | None:
    """Return the setting of the spec at the step of the run."""
    h = tuner.problem.step
    span = confirming_span(tuner, current, h) if tuner.clock.left(CONFIRMED) > 0 else 0.0
    point = tuner.measures[current.bounded](tuner.methods[current.key], h, span) if span else None
    return Finalist(current, point) if point else None


def time_all(finalists: Sequence[Finalist], tuner: Tuner) -> list[Finalist]:
    """Return the methods with timings in several rounds, at least one.

    The methods are timed in turn, so that disturbances affect all of them alike.
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
