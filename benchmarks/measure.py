"""Measurement of errors and times: a scan finds the fastest setting of each method for each target.

Afterwards the fastest settings of all methods are timed in turn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import median

import numpy as np
import sympy

from benchmarks.problems import Problem
from benchmarks.solvers import Method

#: Number of times at which states of a run are sampled, by horizon. Between two samples phigen makes a multiple of
#: BLOCK = 8 steps, since its solvers make steps in blocks of 8.
SAMPLES = {"short": 125, "long": 500}
BLOCK = 8

#: Factor between neighbouring step sizes of a scan; tolerances differ by a factor of ten. Scans of step sizes begin at
#: ``Problem.first``, scans of tolerances at FIRST_TOLERANCE.
FINER = 2 ** (1 / 3)
FIRST_TOLERANCE, SMALLEST_TOLERANCE = 1e-4, 2.3e-16

#: Number of the finest step size of a grid; time limits end every scan before it is reached.
FINEST = 60

#: Largest number of runs over the long horizon for one method and target.
MOST_LONG_RUNS = 6

#: Largest Casimir error of phigen's runs. A larger error means that Newton's method did not converge, or that steps are
#: not Poisson maps.
CONVERGED = 1e-10

#: Runs that take more seconds than this are timed only once.
ONCE = 2.0

Target = tuple[str, float]
ENERGY: tuple[Target, ...] = (("energy", 1e-4), ("energy", 1e-8), ("energy", 1e-12))
ORBIT: tuple[Target, ...] = (("orbit", 1e-4), ("orbit", 1e-8), ("orbit", 1e-10))


@dataclass(frozen=True)
class Result:
    """Result of one run. ``setting`` is a step size or a tolerance.

    ``energy``, ``orbit`` and ``casimir`` are maxima over the samples: relative energy error, distance from the
    reference, Casimir error. ``drift`` is the largest energy error in the last tenth of the samples over that in the
    first tenth.
    """

    method: str
    family: str
    order: int
    setting: float
    seconds: float
    steps: int
    evaluations: float
    status: str
    variant: str = ""
    step_based: bool = True
    row: str = ""
    energy: float = math.nan
    orbit: float = math.nan
    casimir: float = math.nan
    drift: float = math.nan

    def meets(self, target: Target) -> bool:
        return self.status == "ok" and getattr(self, target[0]) <= target[1]

    @property
    def drift_class(self) -> str:
        if self.energy < 1e-12:
            return "round-off"
        return "none" if self.drift < 2.5 else "linear" if self.drift < 25 else "faster"


@dataclass
class Cell:
    """Cell of a table: the fastest setting of a method for a target; ``times`` are its seconds in each round."""

    method: str
    family: str
    target: Target
    result: Result | None
    times: list[float] = field(default_factory=list)


@dataclass
class Study:
    """Measurements of one problem over one horizon."""

    problem: str
    title: str
    horizon: float
    scans: list[Result]
    cells: list[Cell]
    notes: list[str]


class Judge:
    """Evaluation of H and Casimirs on states, independent of the generated code."""

    def __init__(self, problem: Problem, reference: np.ndarray | None = None) -> None:
        def function(text: str) -> sympy.FunctionClass:
            return sympy.lambdify(problem.symbols, problem.parse(text), "numpy")

        self.energy = function(problem.hamiltonian)
        self.casimirs = [function(text) for text in problem.casimirs.values()]
        self.start = np.array(problem.start)
        self.reference = reference

    def errors(self, states: np.ndarray) -> dict[str, float]:
        with np.errstate(all="ignore"):
            energy = np.abs(self.energy(*states.T) / self.energy(*self.start) - 1)
            casimir = 0.0
            for c in self.casimirs:
                before = c(*self.start)
                casimir = max(casimir, float(np.max(np.abs(c(*states.T) - before)) / max(1.0, abs(before))))
        tenth = max(1, len(energy) // 10)
        orbit = float(np.abs(states - self.reference).max()) if self.reference is not None else math.nan
        drift = float(energy[-tenth:].max() / max(energy[:tenth].max(), 1e-300))
        return {"energy": float(energy.max()), "orbit": orbit, "casimir": casimir, "drift": drift}


def run(method: Method, setting: float, horizon: float, samples: int, judge: Judge, limit: float) -> Result:
    """Return the result of one run with its errors. Runs of phigen fail if they do not conserve Casimirs."""
    span = horizon / samples
    chunk = steps_of_sample(method, setting, span) if method.step_based else span
    if method.step_based:
        setting = span / chunk
    done = method.run(judge.start.tolist(), setting, chunk, samples, limit)
    result = Result(
        method.name, method.family, method.order, setting, done.seconds, done.steps, done.evaluations, done.status,
        method.variant, method.step_based, method.row or method.name,
    )  # fmt: skip
    if done.status != "ok":
        return result
    errors = judge.errors(done.states)
    status = "ok"
    if method.family == "phigen" and not errors["casimir"] < CONVERGED:
        status = f"Casimir error above {CONVERGED:.0e}"
    if not math.isfinite(errors["energy"]):
        status = "not finite"
    return Result(**{**result.__dict__, **errors, "status": status})


def steps_of_sample(method: Method, setting: float, span: float) -> int:
    """Return the number of steps between two samples. For phigen it is a multiple of `BLOCK`, if steps are small
    enough."""
    block = BLOCK if method.family == "phigen" and span / setting >= 4 * BLOCK else 1
    return max(1, round(span / setting / block)) * block


@dataclass(frozen=True)
class Grid:
    """Numbered settings of a method: the scan begins at number 0; larger numbers are smaller steps or smaller
    tolerances."""

    method: Method
    problem: Problem

    def setting(self, index: int) -> float:
        if self.method.step_based:
            return self.problem.first / FINER**index
        return max(FIRST_TOLERANCE / 10.0**index, SMALLEST_TOLERANCE)

    def indices(self) -> range:
        """Return all numbers of settings.

        The largest step is the time between two samples; the smallest tolerance is about the precision of numbers.
        """
        if self.method.step_based:
            longest = self.problem.short / SAMPLES["short"]
            return range(-math.floor(math.log(longest / self.problem.first, FINER)), FINEST)
        return range(-3, 1 + math.ceil(math.log10(FIRST_TOLERANCE / SMALLEST_TOLERANCE)))


@dataclass
class Scan:
    """Results of one method over the short horizon, by the numbers of their settings in the `Grid`."""

    grid: Grid
    judge: Judge
    targets: Sequence[Target]
    limit: float
    results: dict[int, Result] = field(default_factory=dict)

    def try_at(self, index: int) -> Result:
        """Return the result of a setting. Settings that give the same number of steps between samples share one run."""
        grid, horizon = self.grid, self.grid.problem.short
        setting, span = grid.setting(index), horizon / SAMPLES["short"]
        if grid.method.step_based:
            setting = span / steps_of_sample(grid.method, setting, span)
        same = [r for r in self.results.values() if r.setting == setting]
        result = same[0] if same else run(grid.method, setting, horizon, SAMPLES["short"], self.judge, self.limit)
        self.results[index] = result
        return result

    def extend_finer(self) -> None:
        """Try settings 0, 1, 2, … until every target is met, or a run takes too long."""
        for index in self.grid.indices():
            if index < 0:
                continue
            result = self.try_at(index)
            met = all(any(r.meets(t) for r in self.results.values()) for t in self.targets)
            if met or result.status == "too slow" or result.seconds > self.limit:
                break

    def extend_coarser(self) -> None:
        """Try settings −1, −2, … as long as the coarsest tried setting is the fastest for some target."""
        while self.best_at_coarse_end():
            index = min(self.results) - 1
            if index not in self.grid.indices():
                break
            self.try_at(index)

    def best_at_coarse_end(self) -> list[Target]:
        """Return the targets for which the coarsest tried setting is the fastest, so that a coarser one might be
        faster."""
        first = self.results[min(self.results)]
        return [t for t in self.targets if cheapest(list(self.results.values()), t) is first]

    def failure(self) -> str:
        """Return a message if the coarsest possible setting is the fastest for some target, else "".

        In this case the fastest setting is unknown, since a still coarser one might be faster.
        """
        ends = [f"{name} {bound:.0e}" for name, bound in self.best_at_coarse_end()]
        coarsest = self.results[min(self.results)].setting
        return f"{self.grid.method.name}: {coarsest:.3g} is the best for {', '.join(ends)}" if ends else ""


def scan(method: Method, problem: Problem, judge: Judge, targets: Sequence[Target], limit: float) -> Scan:
    """Return the scan of a method: settings from coarse to fine until all targets are met, then coarser ones if
    these help."""
    scanned = Scan(Grid(method, problem), judge, targets, limit)
    scanned.extend_finer()
    scanned.extend_coarser()
    return scanned


def reach(scanned: Scan, judge: Judge, target: Target, limit: float, results: dict[int, Result]) -> None:
    """Run a method over the long horizon, and add the runs to ``results`` by the numbers of their settings.

    The first setting is the coarsest that should meet the target according to the runs over the short horizon. Finer
    settings follow until the target is met, or coarser settings as long as it is met. Runs that are expected to take
    more seconds than ``limit`` are not started.
    """
    grid, growth = scanned.grid, scanned.grid.problem.long / scanned.grid.problem.short
    usable = {k: r for k, r in scanned.results.items() if r.status == "ok"}
    if not usable:
        return
    expected = [k for k, r in usable.items() if r.energy * (growth if r.drift > 2.5 else 1) <= target[1]]
    index = max(expected, key=lambda k: usable[k].setting) if expected else max(usable) + 1
    nearest = usable[min(usable, key=lambda k: abs(k - index))]
    seconds = growth * nearest.seconds
    direction = 0
    for _ in range(MOST_LONG_RUNS):
        if index not in grid.indices() or seconds > limit:
            break
        if index not in results:
            results[index] = run(
                grid.method, grid.setting(index), grid.problem.long, SAMPLES["long"], judge, 1.5 * limit
            )
        met, seconds = results[index].meets(target), results[index].seconds
        if results[index].status == "too slow" or direction == (1 if met else -1):
            break
        direction = -1 if met else 1
        index += direction
        seconds *= FINER**direction


def cheapest(results: Sequence[Result], target: Target) -> Result | None:
    return min((r for r in results if r.meets(target)), key=lambda r: r.seconds, default=None)


def time_cells(
    cells: Sequence[Cell], methods: dict[str, Method], horizon: float, samples: int, judge: Judge, rounds: int
) -> None:
    """Time the settings of all cells in turn, round after round: A B C A B C …, so that a disturbance affects all
    methods."""
    chosen: dict[tuple[str, float], list[Cell]] = {}
    for cell in cells:
        if cell.result:
            chosen.setdefault((cell.result.method, cell.result.setting), []).append(cell)
    for _ in range(rounds):
        for (name, setting), served in chosen.items():
            if served[0].times and served[0].times[0] > ONCE:
                continue
            seconds = run(methods[name], setting, horizon, samples, judge, math.inf).seconds
            for cell in served:
                cell.times.append(seconds)


def ratios(numerator: Sequence[float], denominator: Sequence[float]) -> tuple[float, float, float]:
    """Return median, least and largest ratio of times that were measured in the same round."""
    each = [a / b for a, b in zip(numerator, denominator, strict=False)]
    return median(each), min(each), max(each)
