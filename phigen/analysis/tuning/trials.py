"""Errors and times of a compiled method on one initial value problem."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from phigen.analysis.arrays import Floats, evaluate
from phigen.analysis.race import Runner
from phigen.analysis.summary import errors_of
from phigen.geometry.system import System
from phigen.runtime.interface import Backend, BackendError, row_steps
from phigen.runtime.session import rows_along

#: States at which the energy of one run is looked at, at most; and times at which an orbit is compared.
ROWS, MARKS = 8_000, 256
#: One rounding moves the energy by about this much, relatively; over n steps they add up like a random walk.
ROUNDING = 1.1e-16
#: A measurement of time lasts at least so many seconds.
LEAST_SECONDS = 2e-3
#: Steps that are timed: first so few, then in parts that double from at most so many, and in all.
FEW_STEPS, PART_STEPS, TIMED_STEPS = 64, 4096, 32_768
#: Errors that grow faster than this power of time are those of chaotic motion; and slower than that they are linear,
#: but for oscillations.
LINEAR, STEADY = 1.8, 1.3


@dataclass(frozen=True)
class Problem:
    """What is solved: the numbers of a run, and for how long. ``step`` is that of the run, a first guess.

    Steps and times are positive here; ``direction`` is −1 for a run back in time.
    """

    system: System
    start: Floats
    parameters: Mapping[str, float]
    step: float
    horizon: float
    direction: float = 1.0

    def energies(self, states: Floats) -> Floats:
        """H of states (rows, DIM)."""
        values = {**self.parameters, **{c: states[:, i] for i, c in enumerate(self.system.coordinates)}}
        (found,) = evaluate([self.system.hamiltonian], values)
        return np.broadcast_to(found, (len(states),))


class Method(Protocol):
    """A compiled method, started from the problem's initial state."""

    def rows(self, h: float, steps: int, stride: int) -> Floats | None:
        """States (rows, DIM) after 0, stride, 2·stride, … and all steps; None if one cannot be made."""
        ...

    def walk(self, h: float) -> Callable[[int], object]:
        """A function to be timed: from the start, it makes so many steps, and with each call so many more."""
        ...


@dataclass(frozen=True)
class Candidate:
    """A solver of phigen's as a method."""

    solver: Backend
    problem: Problem

    def rows(self, h: float, steps: int, stride: int) -> Floats | None:
        problem = self.problem
        try:
            session = self.solver.start(problem.start, problem.parameters)
            found = rows_along(session, problem.direction * h, steps, stride, None)
        except BackendError:
            return None
        return found if np.isfinite(found).all() else None

    def reach(self, h: float, steps: int) -> tuple[float, str]:
        """The time of the last step that can be made, and the status of the next, of so many."""
        try:
            session = self.solver.start(self.problem.start, self.problem.parameters)
            session.advance(self.problem.direction * h, steps)
        except BackendError as error:
            return error.step * h, error.status
        return steps * h, "OK"

    def walk(self, h: float) -> Callable[[int], object]:
        session = self.solver.start(self.problem.start, self.problem.parameters)
        return lambda steps: session.advance(self.problem.direction * h, steps)


@dataclass(frozen=True)
class Classical:
    """A classical method in compiled C as a method; ``state`` is where its runner starts."""

    runner: Runner
    state: Floats
    problem: Problem

    def rows(self, h: float, steps: int, stride: int) -> Floats | None:
        marks = row_steps(steps, stride)
        states = np.empty((len(marks), len(self.state)))
        states[0] = self.problem.start
        for row in range(1, len(marks)):
            self.state[:] = states[row - 1]
            found = self.runner(self.problem.direction * h, int(marks[row] - marks[row - 1]), 1)
            if found is None:
                return None
            states[row] = found
        return states

    def walk(self, h: float) -> Callable[[int], object]:
        # Its steps take the same time everywhere: all calls start where the problem does.
        self.state[:] = self.problem.start
        return lambda steps: self.runner(self.problem.direction * h, steps, 1)


@dataclass(frozen=True)
class Point:
    """One step size: the error measured over ``time``, what it means for the horizon, and the cost of a step.

    ``error`` is at the horizon, ``measured`` over the time. ``growth`` is the power of time with which it grows, NaN
    where that cannot be told; ``rounding`` the part of the error that smaller steps do not reduce, as far as is known.
    """

    step: float
    error: float
    measured: float
    time: float
    nanoseconds: float
    growth: float = math.nan
    rounding: float = 0.0

    @property
    def cost(self) -> float:
        """Nanoseconds of one unit of time."""
        return self.nanoseconds / self.step


#: States (count + 1, DIM) of the solution at the multiples of a spacing: ``reference(spacing, count)``.
Solution = Callable[[float, int], Floats]

#: Measures a method at a step over a time; None if a step cannot be made.
Measure = Callable[[Method, float, float], Point | None]


def steps_in(span: float, h: float) -> int:
    """The number of steps that fill a span of time, at least one."""
    return max(1, round(span / h))


def marks(span: float, h: float) -> tuple[int, int]:
    """A stride in steps, and how many of it fill a span with about `MARKS`: not more, since the solution may end."""
    stride = max(1, round(span / h / MARKS))
    return stride, max(1, int(span / h / stride + 1e-9))


def nanoseconds_per_step(method: Method, h: float, steps: int) -> float:
    """CPU time on this thread of one of the steps of a run, the fastest of some; NaN if they cannot be made.

    Without what is done once, such as choosing a gauge, and without the call from Python.
    """
    fastest = call = math.inf
    spent = 0.0
    try:
        while spent < LEAST_SECONDS:
            walk = method.walk(h)
            walk(1)
            call = min(call, _seconds(walk, 1))
            taken, expected = _run_seconds(method.walk(h), steps)
            fastest, spent = min(fastest, expected), spent + taken
    except BackendError:
        return math.nan
    return 1e9 * max(fastest - call, 0.1 * fastest) / max(steps - 1, 1)


def _run_seconds(walk: Callable[[int], object], steps: int) -> tuple[float, float]:
    """The seconds that were taken, and those that all steps of a run would take.

    Of a long run only so many are made that the rest should be as fast as the last of them: a solver in C first learns
    the motion, then foresees it, and goes on in blocks of steps, several times as fast.
    """
    taken, done, part = 0.0, 0, min(FEW_STEPS, steps)
    while True:
        last = _seconds(walk, part)
        taken, done = taken + last, done + part
        if done >= min(steps, TIMED_STEPS) or last >= LEAST_SECONDS:
            return taken, taken + last * (steps - done) / part
        lasting = int(part * LEAST_SECONDS / last)
        part = min(max(done, min(lasting, PART_STEPS)), steps - done)


def _seconds(walk: Callable[[int], object], steps: int) -> float:
    start = time.thread_time()
    walk(steps)
    return max(time.thread_time() - start, 1e-8)


def energy_measure(problem: Problem, *, bounded: bool = True) -> Measure:
    """The largest error of the energy on the way, relative to its initial value unless that is negligible.

    For phigen's methods it is ``bounded``: the same over the horizon, but for rounding. That of others grows with
    time wherever it was seen to grow.
    """
    scale = float(np.max(np.abs(problem.start), initial=0.0))

    def measure(method: Method, h: float, span: float) -> Point | None:
        steps = steps_in(span, h)
        stride = max(1, steps // ROWS)
        states = method.rows(h, steps, stride)
        if states is None:
            return None
        errors, _ = errors_of(problem.energies(states), scale)
        largest = float(np.max(errors))
        if not math.isfinite(largest):
            return None
        # A method that does not drift still shows what rounding does.
        largest, made = max(largest, ROUNDING), steps * h
        growth = _growth(errors)
        ratio = max(problem.horizon / made, 1.0)
        rounding = ROUNDING * math.sqrt(steps * ratio)
        more = rounding - ROUNDING * math.sqrt(steps)
        error = largest + more if bounded else largest * math.pow(ratio, growth if growth > 0.3 else 0.0) + more
        cost = nanoseconds_per_step(method, h, steps_in(problem.horizon, h))
        return Point(h, error, largest, made, cost, growth, rounding) if math.isfinite(cost) else None

    return measure


def orbit_measure(problem: Problem, reference: Solution, *, bounded: bool = True) -> Measure:
    """The largest distance from a reference at about `MARKS` times, relative to the largest coordinate there is.

    Up to the horizon the error of phigen's methods is taken to grow linearly in time, since that of their energy is
    ``bounded``, unless it was seen to grow faster, as rounding does; that of others at least linearly.
    """

    def measure(method: Method, h: float, span: float) -> Point | None:
        stride, count = marks(span, h)
        states = method.rows(h, stride * count, stride)
        if states is None:
            return None
        expected = reference(stride * h, count)
        size = float(np.max(np.abs(expected))) or 1.0
        errors = np.max(np.abs(states - expected), axis=1) / size
        largest = max(float(np.max(errors)), ROUNDING)
        growth, made = _growth(errors), stride * count * h
        power = 1.0 if math.isnan(growth) or (bounded and growth < STEADY) else min(max(growth, 1.0), 2.0)
        error = largest * math.pow(max(problem.horizon / made, 1.0), power)
        cost = nanoseconds_per_step(method, h, steps_in(problem.horizon, h))
        return Point(h, error, largest, made, cost, growth) if math.isfinite(cost) else None

    return measure


def _growth(errors: Floats) -> float:
    """The power of time with which errors at equidistant times grow: from their maxima over halves of the run."""
    if len(errors) < 5:
        return math.nan
    half = len(errors) // 2 + 1
    early, late = float(np.max(errors[:half])), float(np.max(errors))
    return math.log2(late / early) if early > 10 * ROUNDING else math.nan
