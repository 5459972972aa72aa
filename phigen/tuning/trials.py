"""Errors of methods with one step size: measured over a part of a run, and extrapolated to the whole run."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from phigen.study.methods import size_of
from phigen.symbolic.arrays import Floats
from phigen.tuning.problem import ROUNDING, CompiledMethod, Problem, steps_in
from phigen.tuning.timing import nanoseconds_per_step

#: Approximate number of equidistant times at which an orbit is compared with the reference solution.
MARKS = 256
#: Bounds for the power p of errors that grow like t^p. Above LARGEST_REGULAR_GROWTH, the motion counts as chaotic.
#: Below LARGEST_LINEAR_GROWTH, the growth counts as linear: oscillations of the errors change the fitted p.
LARGEST_REGULAR_GROWTH, LARGEST_LINEAR_GROWTH = 1.8, 1.3


@dataclass(frozen=True)
class Point:
    """Result of a method with one step size: its error, and the time of a step in ``nanoseconds``.

    ``measured`` is the largest error in a run over ``time``. ``error`` is the error that is expected over the whole
    duration (horizon). ``growth`` is the power of time with which the error grows, NaN if unknown. ``rounding`` is the
    part of the error that comes from rounding; smaller steps do not reduce it. ``unit`` is the relative rounding error
    of one step.
    """

    step: float
    error: float
    measured: float
    time: float
    nanoseconds: float
    growth: float = math.nan
    rounding: float = 0.0
    unit: float = ROUNDING

    @property
    def cost(self) -> float:
        """Processor time in nanoseconds per unit of simulated time."""
        return self.nanoseconds / self.step


#: A solution: function of (spacing, count) that returns the states (count + 1, DIM) at 0, 1, …, count times the
#: spacing.
Solution = Callable[[float, int], Floats]

#: A measurement: function of (method, step size, duration of the run) that returns a `Point`, or None if a step fails.
Measure = Callable[[CompiledMethod, float, float], Point | None]


def marks(span: float, h: float) -> tuple[int, int]:
    """Return a stride, as a number of steps of size ``h``, and the number of strides that fit into a time span.

    The number of strides is about `MARKS`.
    """
    stride = max(1, round(span / h / MARKS))
    return stride, max(1, int(span / h / stride + 1e-9))


def energy_measure(problem: Problem, *, bounded: bool = True) -> Measure:
    """Return the function that measures the largest energy error in a run, in the unit of the energy.

    ``bounded`` is for Poisson maps, whose energy error does not grow with time, apart from rounding errors. The error
    of other methods is extrapolated to the horizon if it grows with time.
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
        rounding_unit = method.rounding
        # Even if the measured error is 0, rounding errors are expected in a longer run.
        largest, time = max(largest, rounding_unit), steps * h
        growth = _growth(errors, rounding_unit)
        ratio = max(problem.horizon / time, 1.0)
        rounding = rounding_unit * math.sqrt(steps * ratio)
        excess = rounding - rounding_unit * math.sqrt(steps)
        error = largest + excess if bounded else largest * math.pow(ratio, growth if growth > 0.3 else 0.0) + excess
        cost = nanoseconds_per_step(method, h, steps_in(problem.horizon, h))
        return Point(h, error, largest, time, cost, growth, rounding, rounding_unit) if math.isfinite(cost) else None

    return measure


def orbit_measure(problem: Problem, reference: Solution, *, bounded: bool = True) -> Measure:
    """Return the function that measures the largest distance of a run from a reference solution.

    States are compared at about `MARKS` times. The distance is relative to the largest coordinate, and is extrapolated
    to the horizon by a power of time. The power is the measured one, at least 1 and at most 2. For methods with
    ``bounded`` energy errors (Poisson maps) the power is 1, unless the distance clearly grows faster.
    """

    def measure(method: CompiledMethod, h: float, span: float) -> Point | None:
        stride, count = marks(span, h)
        states = method.rows(h, stride * count, stride)
        if states is None:
            return None
        expected = reference(stride * h, count)
        size = size_of(expected)
        errors = np.max(np.abs(states - expected), axis=1) / size
        rounding_unit = method.rounding
        largest = max(float(np.max(errors)), rounding_unit)
        growth, time = _growth(errors, rounding_unit), stride * count * h
        power = (
            1.0 if math.isnan(growth) or (bounded and growth < LARGEST_LINEAR_GROWTH) else min(max(growth, 1.0), 2.0)
        )
        error = largest * math.pow(max(problem.horizon / time, 1.0), power)
        cost = nanoseconds_per_step(method, h, steps_in(problem.horizon, h))
        return Point(h, error, largest, time, cost, growth, unit=rounding_unit) if math.isfinite(cost) else None

    return measure


def _growth(errors: Floats, rounding_unit: float) -> float:
    """Return the power of time with which errors at equidistant times grow; NaN if it cannot be determined.

    The power follows from the largest error in the first half of the run, and the largest error in the whole run.
    """
    if len(errors) < 5:
        return math.nan
    half_count = len(errors) // 2 + 1
    early_maximum, late_maximum = float(np.max(errors[:half_count])), float(np.max(errors))
    return math.log2(late_maximum / early_maximum) if early_maximum > 10 * rounding_unit else math.nan
