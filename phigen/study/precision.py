"""Errors of a solver and of classical methods against step size and computing time, for one initial value problem."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from phigen.study import classical
from phigen.study.methods import size_of
from phigen.study.race import OWN, Race, Runner
from phigen.symbolic.arrays import Floats

#: To obtain several step sizes, the step of the run is doubled up to COARSER times, and halved up to FINER times.
COARSER, FINER = 6, 7
#: ROUNDS: how often a time is measured; the shortest time counts. LEAST_SECONDS: least duration of a measurement, which
#: may contain several runs. MOST_SECONDS: a run that takes longer is the last one of its method.
ROUNDS, LEAST_SECONDS, MOST_SECONDS = 5, 2e-3, 0.05
#: Only the beginning of a run is studied, because errors may grow too fast in a long run. These numbers of steps are
#: tried one after another, until the errors decrease with the step size as the order of the solver predicts.
SPANS = (4096, 256, 16)
#: An order is determined from errors that are smaller than ASYMPTOTIC, and larger than ABOVE_FLOOR times the error of
#: the reference solution.
ABOVE_FLOOR, ASYMPTOTIC = 30.0, 0.02
#: ROUNDING: smallest measurable error. SMALL: error below which rounding may dominate. Errors are relative to the
#: solution.
ROUNDING, SMALL = 2.0**-52, 1e-6


@dataclass(frozen=True)
class PrecisionPoint:
    """Result with one step size: relative errors at the end of the run, and computing time.

    ``error`` is the error of the solution, ``casimirs`` the largest error of a Casimir. ``seconds`` is the time of the
    fastest repetition.
    """

    step: float
    steps: int
    error: float
    casimirs: float
    seconds: float


@dataclass(frozen=True)
class PrecisionCurve:
    """Results of one method with all step sizes, the largest first.

    ``order`` is the stated order, ``slope`` the observed one, NaN if it cannot be determined.
    """

    label: str
    order: int
    points: tuple[PrecisionPoint, ...]
    slope: float

    def seconds_for(self, tolerance: float) -> float:
        """Return the shortest time, in seconds, of the points whose error is at most ``tolerance``; NaN if there are
        none.
        """
        return min((p.seconds for p in self.points if p.error <= tolerance), default=math.nan)


@dataclass(frozen=True)
class Study:
    """Results of all methods, one curve each.

    The methods integrate from 0 to ``time``, which is the duration of ``steps`` steps of the run. ``clock`` is the
    variable in which ``time`` is measured, t or τ. Errors below ``floor`` are errors of the ``reference`` solution. The
    times of the points do not contain ``set_up``, the seconds that the solver needs once for each trajectory. All
    methods are written in ``language``; ``rounds`` is the number of repetitions.
    """

    time: float
    steps: int
    floor: float
    reference: str
    set_up: float
    language: str
    rounds: int
    curves: tuple[PrecisionCurve, ...]
    clock: str = "t"

    @property
    def has_casimirs(self) -> bool:
        """Whether the errors of Casimirs were measured."""
        return any(math.isfinite(p.casimirs) for c in self.curves for p in c.points)


def study(
    race: Race,
    order: int,
    h: float,
    steps: int,
    solution: Callable[[float], Floats] | None = None,
    casimirs: Callable[[Floats], float] | None = None,
    rounds: int = ROUNDS,
) -> Study:
    """Run all methods of ``race`` with several step sizes, larger and smaller than ``h``, and measure the times.

    The runs cover the beginning of a run of ``steps`` steps of size h. ``order`` is the order of the solver.
    ``solution(t)`` is the closed form, if there is one. Otherwise DOP853 provides the reference solution, with steps so
    small that halving them no longer changes the result. ``casimirs(x)`` returns the largest error of a Casimir at a
    state. Raises `ArithmeticError` if DOP853 cannot follow the solution.
    """
    for span in sorted({min(steps, s) for s in SPANS}, reverse=True):
        target, floor = (solution(h * span), 4 * ROUNDING) if solution else _by_dop853(race, h * span, span)
        states = {label: _states(run, h * span, span, target, floor) for label, run in race.runners.items()}
        errors = {label: {n: error_of(x, target) for n, x in of_steps.items()} for label, of_steps in states.items()}
        slopes = {label: slope(of_steps, floor) for label, of_steps in errors.items()}
        if math.isfinite(slopes[OWN]):
            break
    if not math.isfinite(floor):
        raise ArithmeticError("DOP853 cannot follow the solution")
    seconds = _times(race, {label: list(of_steps) for label, of_steps in errors.items()}, h * span, rounds)
    orders = {OWN: order, **{m: o for m, (_, o) in classical.METHODS.items()}}
    curves = []
    for label, of_steps in states.items():
        points = tuple(
            PrecisionPoint(h * span / n, n, errors[label][n], casimirs(x) if casimirs else math.nan, seconds[label, n])
            for n, x in of_steps.items()
        )
        curves.append(PrecisionCurve(label, orders[label], points, slopes[label]))
    reference = "the closed form" if solution else "DOP853 at small steps"
    return Study(h * span, span, floor, reference, seconds["", 0], race.language, rounds, tuple(curves), race.clock)


def error_of(state: Floats, target: Floats) -> float:
    """Return the largest error of a coordinate, relative to the largest coordinate."""
    return max(float(np.max(np.abs(state - target))) / size_of(target), ROUNDING)


def slope(errors: Mapping[int, float], floor: float) -> float:
    """Return the observed order; ``errors`` maps numbers of steps to errors.

    The order is log₂ of the quotient of the errors with n and 2n steps. Both errors must be in the asymptotic range,
    where they are neither rounding errors nor very large. The result is the median for the three largest n. It is NaN
    if no n has two errors in this range.
    """
    # An error that grows although the number of steps grows is a rounding error.
    floor = max([floor, *(b for a, b in pairwise(errors.values()) if a < b and a < SMALL)])
    usable = {n: e for n, e in errors.items() if ABOVE_FLOOR * floor < e < ASYMPTOTIC}
    slopes = [math.log2(e / usable[2 * n]) for n, e in usable.items() if 2 * n in usable]
    return float(np.median(slopes[-3:])) if slopes else math.nan


def _states(run: Runner, end: float, span: int, target: Floats, floor: float) -> dict[int, Floats]:
    """Return a dict from numbers of steps, in increasing order, to the states at the time ``end``.

    Numbers of steps are increased until rounding dominates the error, or until a run takes longer than `MOST_SECONDS`.
    Runs that fail, or whose error is as large as the solution, are left out.
    """
    states: dict[int, Floats] = {}
    least, count = math.inf, 0
    for n in sorted({round(span * f * 2.0**k) for k in range(-COARSER, FINER + 1) for f in (1.0, 1.5)} - {0}):
        start = time.perf_counter()
        state = run(end / n, n, 1)
        # If the reference solution failed, the error is NaN. Then "not error < 1" is true, too.
        if state is None or not (error := error_of(state, target)) < 1:
            continue
        states[n] = state
        count += error <= 2 * floor or 2 * error > least < SMALL
        least = min(least, error)
        if count > 1 or time.perf_counter() - start > MOST_SECONDS:
            break
    return states


def _times(race: Race, counts: Mapping[str, Sequence[int]], end: float, rounds: int) -> dict[tuple[str, int], float]:
    """Return the time of one run in seconds, for each method and number of steps (``counts``).

    Runs are repeated, and the shortest time is returned. In each repetition all methods take turns. The key ("", 0) has
    the set-up time of the solver.
    """
    works: dict[tuple[str, int], Callable[[int], object]] = {("", 0): race.set_up}
    for label, run in race.runners.items():
        for n in counts[label]:
            works[label, n] = lambda repeats, run=run, n=n: run(end / n, n, repeats)  # type: ignore[misc]
    fastest = dict.fromkeys(works, math.inf)
    repeats = dict.fromkeys(works, 1)
    for _ in range(rounds):
        for key, work in works.items():
            start = time.perf_counter()
            work(repeats[key])
            seconds = (time.perf_counter() - start) / repeats[key]
            fastest[key] = min(seconds, fastest[key])
            repeats[key] = max(1, math.ceil(LEAST_SECONDS / max(seconds, 1e-8)))
    return fastest


def _by_dop853(race: Race, end: float, span: int) -> tuple[Floats, float]:
    """Return the solution at the time ``end`` by DOP853, and its estimated relative error.

    The step is halved repeatedly. Results with a step and with half that step are compared; the least difference is the
    estimate. The estimate is infinite if all runs fail.
    """
    best, last = (np.full(1, np.nan), math.inf), None
    for k in range(-2, FINER):
        n = max(1, math.ceil(span * 2.0**k))
        state = race.runners["dop853"](end / n, n, 1)
        if state is not None and last is not None:
            difference = max(error_of(last, state), 4 * ROUNDING)
            best = (state, difference) if difference < best[1] else best
        last = state
    return best
