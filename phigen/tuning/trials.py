"""Errors of a method at one step size, over a piece of a run, and what they mean for all of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from phigen.symbolic.arrays import Floats
from phigen.tuning.problem import CompiledMethod, Problem, steps_in
from phigen.tuning.timing import nanoseconds_per_step

#: Times at which an orbit is compared.
MARKS = 256
#: One rounding moves the energy by about this much, relatively; over n steps they add up like a random walk.
ROUNDING = 1.1e-16
#: Errors that grow faster than this power of time are those of chaotic motion; and slower than that they are linear,
#: but for oscillations.
LINEAR, STEADY = 1.8, 1.3


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
Measure = Callable[[CompiledMethod, float, float], Point | None]


def marks(span: float, h: float) -> tuple[int, int]:
    """A stride in steps, and how many of it fill a span with about `MARKS`: not more, since the solution may end."""
    stride = max(1, round(span / h / MARKS))
    return stride, max(1, int(span / h / stride + 1e-9))


def energy_measure(problem: Problem, *, bounded: bool = True) -> Measure:
    """The largest error of the energy on the way, in its unit.

    That of Poisson maps is ``bounded``: the same over the horizon, but for rounding. That of others grows with time
    wherever it was seen to grow.
    """
    unit = problem.unit

    def measure(method: CompiledMethod, h: float, span: float) -> Point | None:
        steps = steps_in(span, h)
        stride = max(1, steps // problem.most_rows)
        states = method.rows(h, steps, stride)
        if states is None:
            return None
        energies = problem.energies(states)
        errors = unit.errors(energies, float(energies[0]))
        largest = float(np.max(errors))
        if not math.isfinite(largest):
            return None
        # A method that does not drift still shows what rounding does.
        largest, time = max(largest, ROUNDING), steps * h
        growth = _growth(errors)
        ratio = max(problem.horizon / time, 1.0)
        rounding = ROUNDING * math.sqrt(steps * ratio)
        more = rounding - ROUNDING * math.sqrt(steps)
        error = largest + more if bounded else largest * math.pow(ratio, growth if growth > 0.3 else 0.0) + more
        cost = nanoseconds_per_step(method, h, steps_in(problem.horizon, h))
        return Point(h, error, largest, time, cost, growth, rounding) if math.isfinite(cost) else None

    return measure


def orbit_measure(problem: Problem, reference: Solution, *, bounded: bool = True) -> Measure:
    """The largest distance from a reference at about `MARKS` times, relative to the largest coordinate there is.

    Up to the horizon the error of Poisson maps is taken to grow linearly in time, since that of their energy is
    ``bounded``, unless it was seen to grow faster, as rounding does; that of others at least linearly.
    """

    def measure(method: CompiledMethod, h: float, span: float) -> Point | None:
        stride, count = marks(span, h)
        states = method.rows(h, stride * count, stride)
        if states is None:
            return None
        expected = reference(stride * h, count)
        size = float(np.max(np.abs(expected))) or 1.0
        errors = np.max(np.abs(states - expected), axis=1) / size
        largest = max(float(np.max(errors)), ROUNDING)
        growth, time = _growth(errors), stride * count * h
        power = 1.0 if math.isnan(growth) or (bounded and growth < STEADY) else min(max(growth, 1.0), 2.0)
        error = largest * math.pow(max(problem.horizon / time, 1.0), power)
        cost = nanoseconds_per_step(method, h, steps_in(problem.horizon, h))
        return Point(h, error, largest, time, cost, growth) if math.isfinite(cost) else None

    return measure


def _growth(errors: Floats) -> float:
    """The power of time with which errors at equidistant times grow: from their maxima over halves of the run."""
    if len(errors) < 5:
        return math.nan
    half = len(errors) // 2 + 1
    early, late = float(np.max(errors[:half])), float(np.max(errors))
    return math.log2(late / early) if early > 10 * ROUNDING else math.nan
