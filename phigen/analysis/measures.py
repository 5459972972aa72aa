"""What verification measures of a one-step method: numbers only, judged elsewhere."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from phigen.analysis.arrays import Floats, evaluate
from phigen.analysis.methods import Method, by_differences
from phigen.errors import StepError
from phigen.geometry.system import System
from phigen.symbolic.expression import Expression, gradient

#: Windows of equal length in which the largest error is taken, to tell drift from oscillation.
WINDOWS = 10

#: Below this error, relative to the size of a quantity, differences say nothing about the method.
ROUNDING = 4e-16

#: Refinements of the step, as factors: pairs two apart halve the step.
_REFINEMENTS = tuple(f * 2**k for k in range(9) for f in (4, 6))


@dataclass(frozen=True)
class Observed:
    """The observed order: the slope between the two finest steps in the asymptotic range; NaN if there are none.

    ``pairs`` lists step sizes and errors relative to the solution, ``floor`` is the error of the reference.
    ``exact`` tells that all errors are at the floor.
    """

    order: float
    pairs: tuple[tuple[float, float], ...]
    floor: float
    exact: bool = False


def observed_order(method: Method, reference: Callable[[float], tuple[Floats, float]], x: Floats, t: float) -> Observed:
    """Errors at time t for steps t/4, t/6, t/8, t/12, …, against ``reference(t)``: a state and its relative error."""
    solution, uncertainty = reference(t)
    size = float(np.max(np.abs(solution)))
    floor = max(uncertainty, 4 * ROUNDING)
    errors: dict[int, float] = {}
    for n in _REFINEMENTS:
        try:
            state = method.rows(x, t / n, n, n)[-1]
        except StepError:
            continue
        errors[n] = float(np.max(np.abs(state - solution))) / size
        if errors[n] < 10 * floor and len(errors) > 4:
            break
    # An order is a statement about small steps; at large ones the error may be of any size.
    usable = {n: e for n, e in errors.items() if 30 * floor < e < 0.02}
    slopes = [math.log2(e / usable[2 * n]) for n, e in usable.items() if 2 * n in usable]
    pairs = tuple((t / n, e) for n, e in errors.items())
    exact = bool(errors) and max(errors.values()) <= 30 * floor
    return Observed(float(np.median(slopes[-3:])) if slopes else math.nan, pairs, floor, exact)


@dataclass(frozen=True)
class Drift:
    """The largest error of a conserved quantity in each of `WINDOWS` equal parts of a trajectory, relative to its size.

    A trajectory of fewer steps has one part for each.

    The size at a state is Σ |x_i ∂_i C|, at least |C|: what rounding of the coordinates alone amounts to. As errors add
    up, they are relative to the largest size up to the state that has them: the terms of C may all vanish there.
    """

    windows: tuple[float, ...]

    @property
    def error(self) -> float:
        """The largest error."""
        return max(self.windows)

    @property
    def growth(self) -> float:
        """The error of the last window over that of the first; NaN if there is none."""
        return self.windows[-1] / self.windows[0] if self.windows[0] > 0 else math.nan


def drifts(
    system: System, quantities: Mapping[str, Expression], parameters: Mapping[str, float], rows: Floats
) -> dict[str, Drift]:
    """The drift of each quantity along states (rows, DIM), the first of which is the start."""
    values: dict[str, Any] = {**parameters, **{c: rows[:, i] for i, c in enumerate(system.coordinates)}}
    found = {}
    for name, quantity in quantities.items():
        value, *slopes = (np.broadcast_to(a, len(rows)) for a in _with_gradient(quantity, system.coordinates, values))
        size = np.maximum(np.abs(value[0]), sum(abs(rows[:, i] * g) for i, g in enumerate(slopes)))
        size = np.maximum.accumulate(size)
        error = np.abs(value - value[0]) / np.where(size > 0, size, 1.0)
        windows = np.array_split(error[1:], min(WINDOWS, len(error) - 1))
        found[name] = Drift(tuple(float(np.max(part)) for part in windows))
    return found


def _with_gradient(quantity: Expression, coordinates: Sequence[str], values: Mapping[str, Any]) -> list[Floats]:
    return evaluate([quantity, *gradient(quantity, coordinates)], values)


def size_of(quantity: Expression, coordinates: Sequence[str], values: Mapping[str, Any]) -> float:
    """The largest size of a quantity along a trajectory, as `Drift` counts it."""
    value, *slopes = _with_gradient(quantity, coordinates, values)
    parts = sum(np.abs(values[c] * g) for c, g in zip(coordinates, slopes, strict=True))
    return float(np.max(np.maximum(np.abs(value), parts))) or 1.0


def poisson_matrix(system: System, parameters: Mapping[str, float], x: Floats) -> Floats:
    """π(x), (DIM, DIM)."""
    at = {**parameters, **dict(zip(system.coordinates, x, strict=True))}
    return np.array([float(e) for e in evaluate([e for row in system.poisson for e in row], at)]).reshape((len(x),) * 2)


def poisson_defect(system: System, parameters: Mapping[str, float], method: Method, x: Floats, h: float) -> float:
    """The largest entry of DΦ π DΦᵀ − π∘Φ, relative to |DΦ| |π| |DΦ|ᵀ; DΦ by differences if the code states none."""
    tangent = method.tangent(x, h) if method.tangent else by_differences(method, x, h)
    before, after = (poisson_matrix(system, parameters, state) for state in (x, method.step(x, h)))
    size = float(np.max(np.abs(tangent) @ np.abs(before) @ np.abs(tangent).T))
    return float(np.max(np.abs(tangent @ before @ tangent.T - after))) / (size or 1.0)


def tangent_error(method: Method, x: Floats, h: float) -> float:
    """How far the stated derivative is from differences of the step itself, relative to its largest entry."""
    if method.tangent is None:
        return 0.0
    tangent = method.tangent(x, h)
    return float(np.max(np.abs(tangent - by_differences(method, x, h)))) / float(np.max(np.abs(tangent)))


def reversal(method: Method, x: Floats, h: float) -> float:
    """|Φ_{−h}(Φ_h(x)) − x|, relative to the largest coordinate."""
    return float(np.max(np.abs(method.step(method.step(x, h), -h) - x))) / float(np.max(np.abs(x)))


def largest_step(method: Method, states: Sequence[Floats], h: float, most: float = 256.0) -> float:
    """The largest factor f, to 5 %, for which a step of f·h can be made from all states; 0 if not even h/64."""

    def works(factor: float) -> bool:
        try:
            return all(np.isfinite(method.step(x, factor * h)).all() for x in states)
        except StepError:
            return False

    low = 1.0
    while low > 1 / 64 and not works(low):
        low /= 2
    if not works(low):
        return 0.0
    high = 2 * low
    while high <= most and works(high):
        low, high = high, 2 * high
    if high > most:
        return low
    while high / low > 1.05:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if works(middle) else (low, middle)
    return low
