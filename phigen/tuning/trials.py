"""Errors of a method at one step size over a part of a run, extrapolated to the whole run."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from phigen.symbolic.arrays import Floats
from phigen.tuning.problem import CompiledMethod, Problem, steps_in
from phigen.tuning.timing import nanoseconds_per_step

#: Number of times at which an orbit is compared.
MARKS = 256
#: Relative change of the energy by one rounding; over n steps roundings add up like a random walk.
ROUNDING = 1.1e-16
#: Powers of time by which the growth of errors is classified. Errors that grow faster than LINEAR are those of chaotic
#: motion; slower than STEADY, they are treated as linear apart from oscillations.
LINEAR, STEADY = 1.8, 1.3


@dataclass(frozen=True)
class Point:
    """Measurements at one step size: the error over ``time``, the expected error at the horizon, and the cost of a
    step.

    ``error`` is the error at the horizon, ``measured`` that over the time. ``growth`` is the power of time with which
    it grows, NaN if that is unknown; ``rounding`` is the known part of the error that smaller steps do not reduce.
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
        """Nanoseconds of computing per unit of simulated time."""
        return self.nanoseconds / self.step


#: Function (spacing, count) that returns the states (count + 1, DIM) of the solution at multiples of the spacing.
Solution = Callable[[float, int], Floats]

#: Function (method, step, time) that measures a method; None if a step fails.
Measure = Callable[[CompiledMethod, float, float], Point | None]


def marks(span: float, h: float) -> tuple[int, int]:
    """Return a stride in steps, and the number of strides, about `MARKS`, that fill a span without exceeding it."""
    stride = max(1, round(span / h / MARKS))
    return stride, max(1, int(span / h / stride + 1e-9))


def energy_measure(problem: Problem, *, bounded: bool = True) -> Measure:
    """Return the measure of the largest energy error during the run, in the unit of the energy.

    Energy errors of Poisson maps are ``bounded``: the same over the horizon, apart from rounding. Those of other
    methods are extrapolated if they grow with time.
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
        # Rounding errors remain even if a method has no drift.
        largest, time = max(largest, ROUNDING), steps * h
        growth = _growth(errors)
        ratio = max(problem.horizon / time, 1.0)
        rounding = ROUNDING * math.sqrt(steps * ratio)
        excess = rounding - ROUNDING * math.sqrt(steps)
        error = largest + excess if bounded else largest * math.pow(ratio, growth if growth > 0.3 else 0.0) + excess
        cost = nanoseconds_per_step(method, h, steps_in(problem.horizon, h))
        return Point(h, error, largest, time, cost, growth, rounding) if math.isfinite(cost) else None

    return measure


def orbit_measure(problem: Problem, reference: Solution, *, bounded: bool = True) -> Measure:
    """Return the measure of the largest distance from a reference at about `MARKS` times, relative to the largest
    coordinate.

    Orbit errors of Poisson maps are extrapolated linearly in time, since their energy errors are ``bounded``, unless
    they grow faster, as rounding errors do. Orbit errors of other methods are extrapolated at least linearly.
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
    """Return the power of time with which errors at equidistant times grow, from their maxima over both halves of
    the run."""
    if len(errors) < 5:
        return math.nan
    half_count = len(errors) // 2 + 1
    early_maximum, late_maximum = float(np.max(errors[:half_count])), float(np.max(errors))
    return math.log2(late_maximum / early_maximum) if early_maximum > 10 * ROUNDING else math.nan
