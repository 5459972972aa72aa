"""The search for methods for one run: candidates are built, and measured with several steps, within a time budget."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from phigen.compilation import Compilation
from phigen.errors import CheckError, StepError
from phigen.study import race
from phigen.tuning import search
from phigen.tuning.building import Built, Outcome, Refusal, build_all, built
from phigen.tuning.problem import Candidate, Classical, CompiledMethod, Problem, steps_in
from phigen.tuning.references import Reference, agreed, orbit_error
from phigen.tuning.scales import scales
from phigen.tuning.search import Curve
from phigen.tuning.settings import SPLITTING, Setting, direct, own_setting
from phigen.tuning.trials import LARGEST_REGULAR_GROWTH, Measure, Point, energy_measure, marks, orbit_measure

#: Shares of the time budget. SEARCHING: after this share no build starts. BUILDING: largest duration of one round of
#: builds. SCANNING: largest duration of measuring one candidate with several steps. REFERRING: largest duration of
#: computing a reference solution. GUESSING: candidates with a longer expected build are left out of the first round.
SEARCHING, BUILDING, GUESSING, SCANNING, REFERRING = 0.65, 0.2, 0.1, 0.1, 0.05
#: SCANNED: share of the time budget after which no candidate is measured. COMPARED: share after which no classical
#: method is measured.
SCANNED, COMPARED = 0.9, 0.85
#: The measurement of a method ends if reaching the accuracy costs more than a multiple of the least cost so far. WORTH:
#: this multiple for candidates. WORTH_KNOWING: this multiple for classical methods.
WORTH, WORTH_KNOWING = 4.0, 100.0
#: Classical methods with which the result is compared, with their names in tables and their orders.
PEERS = {"rk4": ("RK4", 4), "dop853": ("DOP853", 8)}

Notify = Callable[[str], object]


class TimeBudget:
    """The number of seconds that a search may take, counted from ``start``, a value of `time.perf_counter`.

    The default of ``start`` is the present time.
    """

    def __init__(self, budget: float, start: float | None = None) -> None:
        self.budget, self.start = budget, time.perf_counter() if start is None else start

    def at(self, share: float) -> float:
        """Return the value of `time.perf_counter` at which this share of the budget is used up."""
        return self.start + share * self.budget

    def left(self, share: float) -> float:
        """Return the number of seconds until this share of the budget is used up; it is negative afterwards."""
        return self.at(share) - time.perf_counter()


class Tuner:
    """A search in progress: the candidates that were tried, with their curves, and those that were refused.

    ``measures`` has two functions that measure errors: for methods whose steps are Poisson maps (True), and for others
    (False). ``piece`` is the time span over which candidates are measured, ``most`` the largest useful step.
    ``referring`` says that orbits are compared with a reference solution. Otherwise energies are measured.
    """

    def __init__(
        self,
        compilation: Compilation,
        problem: Problem,
        accuracy: float,
        clock: TimeBudget,
        note: Notify = lambda text: None,
    ) -> None:
        self.compilation, self.problem, self.accuracy = compilation, problem, accuracy
        self.clock, self.note = clock, note
        self.tried: dict[Setting, Curve] = {}
        self.refused: dict[Setting, str] = {}
        self.methods: dict[Setting | str, CompiledMethod] = {}
        self.measures: Mapping[bool, Measure] = {
            is_bounded: energy_measure(problem, bounded=is_bounded) for is_bounded in (True, False)
        }
        self.piece, self.most, self.referring = problem.horizon, math.inf, False
        self._known: dict[str, Setting] = {}
        self._made: dict[Setting, Built] = {}
        self._race: race.Race | None = None
        self._state = problem.start.copy()

    def start(self, measure: str) -> Curve:
        """Measure the setting of the spec with several steps, and return its curve.

        The speed of its method determines the time span of the search. ``measure`` is ``energy`` or ``orbit``. Raises
        `CheckError` if there is no reference solution for orbits, and `StepError` if steps of all sizes fail.
        """
        compilation = self.compilation
        setting = own_setting(compilation)
        build = built(compilation, setting, time.perf_counter() - sum(compilation.seconds.values()))
        method = self.problem.method(build.solver())
        self.piece, self.most = scales(self.problem, method)
        if measure == "orbit":
            self._refer(setting, method)
        curve = self.add(build, method, math.inf)
        if not curve.points:
            raise _unreachable(method, self.problem)
        return curve

    def search(self, current: Curve) -> bool:
        """Try candidates until none is promising, or the time is up; return whether all promising ones were tried.

        ``current`` is the curve of the setting of the spec.
        """
        assert current.setting is not None
        guesses = self.problem.guesses(current.setting)
        limit = GUESSING * self.clock.budget
        proposed = [s for s in guesses if expected_seconds(s, [current]) < limit]
        while proposed and self.clock.left(SEARCHING) > 0:
            self.try_all(proposed)
            proposed = search.proposals(self.tried, list(self.refused), self.accuracy)
        return not proposed

    def add(self, build: Built, method: CompiledMethod, worth: float) -> Curve:
        """Measure a candidate with several step sizes. Store the curve of the results in ``tried``, and return the
        curve.

        The measurement ends early if the candidate needs more than ``worth`` nanoseconds per unit of time of the run
        to reach the accuracy that is asked for.
        """
        setting = build.setting
        self._known[build.fingerprint] = setting
        points = self._scanned(method, build.order, worth, bounded=build.exact)
        curve = Curve(
            build.kind, build.order, points, setting,
            gauged=build.gauged, symmetric=build.symmetric, bounded=build.exact, stages=build.stages,
            composition=build.composition, seconds=build.seconds,
        )  # fmt: skip
        self.tried[setting], self.methods[setting] = curve, method
        return curve

    def peers(self) -> list[Curve]:
        """Measure each classical method with several step sizes, and return the curves. Returns [] if there is no time
        for the measurements.
        """
        current = next(iter(self.tried.values()))
        if self._race is None and current.seconds > self.clock.left(COMPARED):
            return []
        curves = []
        for name, (label, order) in PEERS.items():
            if self.clock.left(COMPARED) <= 0:
                break
            method = self._classical(name)
            label = f"{label} in {self._raced.language}"
            self.methods[label] = method
            points = self._scanned(self.methods[label], order, WORTH_KNOWING * self.least, bounded=False)
            curves.append(Curve(label, order, points, bounded=False))
        return curves

    def try_all(self, settings: Sequence[Setting]) -> None:
        """Build settings in parallel, and measure each with several steps when all builds have ended.

        Results are added to ``tried``, reasons of failures to ``refused``.
        """
        outcomes: dict[Setting, Outcome] = {s: self._made[s] for s in settings if s in self._made}
        until = min(self.clock.at(SEARCHING), time.perf_counter() + BUILDING * self.clock.budget)
        affordable = self._affordable([s for s in settings if s not in self._made])
        if affordable:
            self.note(f"building {len(affordable)} more")
        outcomes |= build_all(self.compilation.spec, self.compilation.known_system, affordable, until)
        for setting in (s for s in settings if s in outcomes):
            outcome = outcomes[setting]
            if isinstance(outcome, Refusal):
                self.refused[setting] = "" if outcome.inapplicable else outcome.reason
            elif not outcome.exact:
                self.refused[setting] = "it is not a Poisson map to round-off"
            elif outcome.fingerprint in self._known:
                self.refused[setting] = ""
            elif self.clock.left(SCANNED) <= 0:
                self.refused[setting] = "there was no time to measure it"
            else:
                curve = self.add(outcome, self.problem.method(outcome.solver()), WORTH * self.least)
                cost = curve.cost(self.accuracy)
                duration = f"{1e-6 * cost * self.problem.horizon:.3g} ms" if math.isfinite(cost) else "not reached"
                self.note(f"{curve.title}: {duration}")

    @property
    def least(self) -> float:
        """Least cost of reaching the accuracy with a method that was tried, in nanoseconds per unit of time."""
        return min((c.cost(self.accuracy) for c in self.tried.values()), default=math.inf)

    def orbit_error(self, curve: Curve, h: float) -> float | None:
        """Return the error of the orbit over the time span of the search, for a method with steps of size ``h``.

        The reference solution is computed by DOP853. The result is None if the run fails, or if there is no reference.
        """
        stride, count = marks(self.piece, h)
        states = self.methods[curve.key].rows(h, stride * count, stride)
        if states is None or self._race is None:
            return None
        seconds = REFERRING * self.clock.budget
        return orbit_error(states, stride * h, self._classical("dop853"), self.problem.step, seconds)

    def _affordable(self, settings: Sequence[Setting]) -> list[Setting]:
        """Return the settings whose builds should end in time. All other settings are added to ``refused``.

        The time of a build is estimated from the builds of lower orders.
        """
        affordable = []
        for setting in settings:
            expected = expected_seconds(setting, self.tried.values())
            if expected > self.clock.left(SEARCHING):
                self.refused[setting] = f"building it would take some {expected:.0f} s"
            else:
                affordable.append(setting)
        return affordable

    def _scanned(self, method: CompiledMethod, order: int, worth: float, *, bounded: bool) -> tuple[Point, ...]:
        until = time.perf_counter() + min(SCANNING * self.clock.budget, max(self.clock.left(SCANNED), 0.0))
        measure, span = self.measures[bounded], self.piece
        return search.scan(
            lambda h: measure(method, h, span), self.problem.step, self.most, self.accuracy, order, worth,
            lambda: time.perf_counter() < until,
        )  # fmt: skip

    @property
    def _raced(self) -> race.Race:
        """The classical methods, which are compiled when they are first needed."""
        if self._race is None:
            self._race = self.problem.classical(self.compilation, list(PEERS), self._state)
        return self._race

    def _classical(self, name: str) -> Classical:
        return Classical(self._raced.runners[name], self._state, self.problem)

    def _refer(self, setting: Setting, method: Candidate) -> None:
        """Compute a reference solution, and measure errors of orbits from now on.

        The reference is computed by a solver of order 8 or more if one can be built, else by the solver of the spec. It
        is confirmed by DOP853.
        """
        problem, until = self.problem, time.perf_counter() + BUILDING * self.clock.budget
        high = replace(setting, order=max(setting.order, 8), composition=direct(setting))
        candidates = [s for s in (Setting(SPLITTING, 8, "none", "auto"), high) if s != setting]
        if high != setting:
            outcomes = build_all(self.compilation.spec, self.compilation.known_system, candidates, until)
            self._made |= {s: outcome for s, outcome in outcomes if isinstance(outcome, Built)}
            built_candidates = [self._made[s] for s in candidates if s in self._made]
            method = problem.method(built_candidates[-1].solver()) if built_candidates else method
        reference = self._reference(method)
        interval = f"{problem.clock} = 0 … {self.piece:.6g}"
        self.note(f"reference: two methods agree to {reference.uncertainty:.1e} over {interval}")
        self.referring = True
        self.measures = {
            is_bounded: orbit_measure(problem, reference, bounded=is_bounded) for is_bounded in (True, False)
        }
        if self.piece < 0.99 * problem.horizon:
            _expect_linear(self.measures[True], method, problem, self.piece)

    def _reference(self, method: CompiledMethod) -> Reference:
        """Return the reference solution over the time span of the search, confirmed by DOP853.

        If DOP853 does not confirm the solution, for instance since the motion is chaotic, the time span of the search
        is shortened. Raises `CheckError` if a shorter time span does not help.
        """
        problem, second, seconds = self.problem, self._classical("dop853"), REFERRING * self.clock.budget
        step, clock = problem.step, problem.clock
        for shorter in (1, 4, 16):
            span = self.piece / shorter
            try:
                reference = agreed(method, second, step, span, self.accuracy * span / problem.horizon, seconds, clock)
            except CheckError as error:
                failure = error
                continue
            self.piece = span
            return reference
        raise failure


def _unreachable(method: Candidate, problem: Problem) -> StepError:
    """Return the exception for a run that the setting of the spec cannot complete with any step size."""
    h = problem.step / 16
    until, status = method.reach(h, steps_in(problem.horizon, h))
    clock = problem.clock
    return StepError(
        f"{problem.name}: the run cannot be followed to {clock} = {problem.horizon:.6g}: with steps of {h:.3g} "
        f"it ends at {clock} = {until:.6g} ({status})\n  hint: the solution itself may end there; see --horizon",
        step=round(until / h), status=status,
    )  # fmt: skip


def _expect_linear(measure: Measure, method: CompiledMethod, problem: Problem, span: float) -> None:
    """Raise `CheckError` if the error of the orbit, measured over ``span``, grows too fast to be extrapolated."""
    h, clock = problem.step, problem.clock
    for _ in range(12):
        point = measure(method, h, span)
        if point and 1e-11 < point.measured < 1e-3:
            if point.growth > LARGEST_REGULAR_GROWTH:
                raise CheckError(
                    f"the error of the orbit grows like {clock}^{point.growth:.1f}: the motion is chaotic, and what is "
                    f"measured over {clock} = 0 … {span:.6g} is no evidence for a longer run\n"
                    f"  hint: --horizon {span:.6g}, or --measure energy"
                )
            return
        h = h / 2 if point is None or point.measured > 1e-3 else 2 * h


def expected_seconds(setting: Setting, tried_curves: Iterable[Curve]) -> float:
    """Return the estimated time of a build in seconds, from the builds of the same method at lower orders.

    The time grows by a factor from each order to the next. For compositions the time is constant, since their code has
    the same length at all orders, apart from the table of stages. The result is 0 if no lower order was built.
    """
    timings = sorted((c.order, c.seconds) for c in tried_curves if c.setting and c.setting.family == setting.family)
    lower_timings = [(order, seconds) for order, seconds in timings if order < setting.order]
    if not lower_timings:
        return 0.0
    order, seconds = lower_timings[-1]
    growth = 2.0 if setting.composition == "none" else 1.0
    if len(lower_timings) > 1 and growth > 1:
        growth = min(max((seconds / lower_timings[-2][1]) ** (2 / (order - lower_timings[-2][0])), 1.5), 8.0)
    return seconds * math.pow(growth, (setting.order - order) / 2)
