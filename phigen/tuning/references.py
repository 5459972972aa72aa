"""Reference solutions for errors of orbits. Two methods compute the same orbit; the difference of their results is the
uncertainty.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field

import numpy as np

from phigen.errors import CheckError
from phigen.study.methods import size_of
from phigen.symbolic.arrays import Floats
from phigen.tuning.problem import CompiledMethod
from phigen.tuning.trials import MARKS

#: The step of a reference solution is halved until the solution changes by less than this fraction of the accuracy.
CONVERGED = 0.02
#: Largest accepted difference between the solutions by two methods, as a fraction of the accuracy.
AGREED = 0.2
_HALVINGS = 16
#: Accuracy of reference solutions, relative to the largest coordinate, if the caller requests no accuracy.
KNOWN = 1e-12


@dataclass
class Reference:
    """A reference solution. A call with (spacing, count) returns the states (count + 1, DIM) at multiples of the
    spacing.

    The states are computed by ``method`` with steps of at most ``step``. ``uncertainty`` is the distance from the
    solution by a second method, relative to the largest coordinate.
    """

    method: CompiledMethod
    step: float
    uncertainty: float
    clock: str = "t"
    _known: dict[tuple[float, int], Floats] = field(default_factory=dict)

    def __call__(self, spacing: float, count: int) -> Floats:
        key = (spacing, count)
        if key not in self._known:
            stride = math.ceil(spacing / self.step)
            rows = self.method.rows(spacing / stride, stride * count, stride)
            if rows is None:
                raise CheckError(f"the reference solution cannot be followed to {self.clock} = {spacing * count:.6g}")
            self._known[key] = rows
        return self._known[key]


def agreed(
    first: CompiledMethod,
    second: CompiledMethod,
    step: float,
    span: float,
    accuracy: float,
    seconds: float,
    clock: str = "t",
) -> Reference:
    """Return the reference solution over a time span by the method ``first``, confirmed by the method ``second``.

    ``accuracy`` is the smallest error that is to be measured with the reference, relative to the largest coordinate.
    ``seconds`` is the time limit of each method. Raises `CheckError` if the two solutions differ too much for this
    accuracy.
    """
    spacing = span / MARKS
    orbits = []
    for method in (first, second):
        converged = _converged(method, min(step, spacing), spacing, MARKS, accuracy, time.perf_counter() + seconds)
        if converged is None:
            raise CheckError(f"no reference solution: a method fails before {clock} = {span:.6g}")
        orbits.append(converged)
    (states, h, _), (second_states, _, _) = orbits
    difference = distance(states, second_states)
    if difference > AGREED * accuracy:
        size = size_of(second_states)
        apart = np.max(np.abs(states - second_states), axis=1) > AGREED * accuracy * size
        raise CheckError(
            f"no reference solution for the orbit: to measure an error of {accuracy:.1e}, two methods with small "
            f"steps must agree, but at {clock} = {spacing * int(np.argmax(apart)):.4g} of {span:.6g} the two solutions "
            "already differ too much\n"
            "  hint: the motion is chaotic, or the error is at rounding level; ask for a shorter --horizon or less "
            "accuracy, or let --measure be energy"
        )
    return Reference(first, h, difference, clock)


def orbit_error(
    states: Floats, spacing: float, reference_method: CompiledMethod, step: float, seconds: float
) -> float | None:
    """Return the largest distance of ``states`` (rows, DIM) from a reference solution.

    The times of the states are multiples of ``spacing``. The distance is relative to the largest coordinate. The
    reference solution is computed by ``reference_method``, with steps of at most ``step``. The result is None if the
    reference solution does not become accurate enough within ``seconds``.
    """
    count, deadline = len(states) - 1, time.perf_counter() + seconds
    orbit = _converged(reference_method, min(step, spacing), spacing, count, KNOWN, deadline)
    if orbit is None:
        return None
    error = distance(states, orbit[0])
    return error if orbit[2] < max(AGREED * error, KNOWN) else None


def distance(states: Floats, reference_states: Floats) -> float:
    """Return the largest difference between two runs (rows, DIM), relative to the largest coordinate of the second."""
    return float(np.max(np.abs(states - reference_states))) / size_of(reference_states)


def _converged(
    method: CompiledMethod, step: float, spacing: float, count: int, accuracy: float, deadline: float
) -> tuple[Floats, float, float] | None:
    """Return the states at ``count`` multiples of a spacing, the last step size, and the last change of the
    states.

    The step is halved until the change is small, or larger than at the previous halving, or until `time.perf_counter`
    exceeds ``deadline``. The result is None if steps of all sizes fail.
    """
    last: Floats | None = None
    best: tuple[Floats, float, float] | None = None
    change = math.inf
    for k in range(_HALVINGS):
        stride = max(1, math.ceil(spacing / step * 2.0**k))
        states = method.rows(spacing / stride, stride * count, stride)
        if states is None:
            continue
        if last is not None:
            previous, change = change, distance(last, states)
            if change > previous and best is not None:
                break
        best, last = (states, spacing / stride, change), states
        if change <= CONVERGED * accuracy or time.perf_counter() > deadline:
            break
    return best
