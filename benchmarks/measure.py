"""Errors and times: a scan finds the cheapest setting of each method for each target, interleaved rounds time these."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from statistics import median

import numpy as np
import sympy

from benchmarks.problems import Problem
from benchmarks.solvers import Method

#: Sampling times of one run; between two samples there are a multiple of 8 steps, which suits blocked solvers.
SAMPLES = {"short": 125, "long": 500}
BLOCK = 8

TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-12, 1e-14, 2.3e-16)

#: A solve that keeps Casimirs this well is a converged one.
CONVERGED = 1e-10

#: What takes more seconds than this is timed once.
ONCE = 2.0

Target = tuple[str, float]
ENERGY: tuple[Target, ...] = (("energy", 1e-4), ("energy", 1e-8), ("energy", 1e-12))
ORBIT: tuple[Target, ...] = (("orbit", 1e-4), ("orbit", 1e-8), ("orbit", 1e-10))


@dataclass(frozen=True)
class Result:
    """One run: maxima over the samples of relative energy error, distance from the reference, Casimir error.

    ``drift`` is the energy error of the last tenth over that of the first; ``setting`` a step size or a tolerance.
    """

    method: str
    family: str
    order: int
    setting: float
    seconds: float
    steps: int
    evaluations: float
    status: str
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
    """The cheapest setting of one method for one target; ``times`` are seconds, one for each round."""

    method: str
    family: str
    target: Target
    result: Result | None
    times: list[float] = field(default_factory=list)


@dataclass
class Study:
    """What was measured on one problem over one horizon."""

    problem: str
    title: str
    horizon: float
    scans: list[Result]
    cells: list[Cell]
    notes: list[str]


class Judge:
    """Evaluates H and the Casimirs on states, independently of the generated code."""

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
    """One integration and its errors; phigen's runs are failures if they lose Casimirs."""
    span = horizon / samples
    if method.step_based:
        chunk = max(1, round(span / setting / BLOCK)) * BLOCK
        setting = span / chunk
    else:
        chunk = span
    done = method.run(judge.start.tolist(), setting, chunk, samples, limit)
    result = Result(
        method.name, method.family, method.order, setting, done.seconds, done.steps, done.evaluations, done.status
    )
    if done.status != "ok":
        return result
    errors = judge.errors(done.states)
    status = "ok"
    if method.family == "phigen" and not errors["casimir"] < CONVERGED:
        status = "Casimir lost"
    if not math.isfinite(errors["energy"]):
        status = "not finite"
    return Result(**{**result.__dict__, **errors, "status": status})


def settings(method: Method, problem: Problem, finer: float) -> Iterator[float]:
    """Steps from coarse to fine by a factor ``finer``, or tolerances."""
    if not method.step_based:
        yield from TOLERANCES
        return
    # low orders never need the coarsest steps
    h = problem.largest * (1.0 if method.order > 4 or method.family == "phigen" else 0.5)
    for k in range(60):
        yield h / finer**k


def scan(method: Method, problem: Problem, judge: Judge, targets: Sequence[Target], limit: float) -> list[Result]:
    """From coarse to fine until every target is met, or a run would be too slow, or only rounding is left."""
    results: list[Result] = []
    seen: set[float] = set()
    for setting in settings(method, problem, 2 ** (1 / 3)):
        result = run(method, setting, problem.short, SAMPLES["short"], judge, limit)
        if result.setting in seen:
            continue
        seen.add(result.setting)
        results.append(result)
        if all(any(r.meets(t) for r in results) for t in targets):
            break
        if result.status == "too slow" or result.seconds > limit:
            break
    return results


def reach(
    method: Method, problem: Problem, judge: Judge, scanned: Sequence[Result], target: Target, limit: float
) -> list[Result]:
    """Runs over the long horizon: the first guess comes from the scan of the short one, then finer until it holds."""
    results: list[Result] = []
    growth = problem.long / problem.short
    usable = sorted((r for r in scanned if r.status == "ok"), key=lambda r: -r.setting)
    expected = [r for r in usable if r.energy * (growth if r.drift > 2.5 else 1) <= target[1]]
    for candidate in expected[:3]:
        result = run(method, candidate.setting, problem.long, SAMPLES["long"], judge, limit)
        results.append(result)
        if result.meets(target) or result.status == "too slow":
            break
    return results


def cheapest(results: Sequence[Result], target: Target) -> Result | None:
    return min((r for r in results if r.meets(target)), key=lambda r: r.seconds, default=None)


def time_cells(
    cells: Sequence[Cell], methods: dict[str, Method], horizon: float, samples: int, judge: Judge, rounds: int
) -> None:
    """Every chosen setting in turn, round after round: A B C A B C …, so that a disturbance meets all alike."""
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
    """Median, least and largest of the ratios of times measured in the same round."""
    each = [a / b for a, b in zip(numerator, denominator, strict=False)]
    return median(each), min(each), max(each)
