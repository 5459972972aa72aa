"""Measurements of one-step methods for verification, without judgement of the results."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from phigen.errors import StepError
from phigen.geometry.system import System
from phigen.study.methods import Method, by_differences, size_of
from phigen.symbolic.arrays import Floats, evaluate

#: Relative rounding error of a few operations. Errors of this size, or a few times larger, do not come from the method.
ROUNDING = 4e-16

#: Finite differences are computed several times. The usual displacements are divided by each of these factors.
DISTANCES = (1.0, 256.0)
#: If all finite differences deviate from the tangent map by more than this fraction of the largest entry of the map,
#: further differences are computed. The displacement of a coordinate is then in proportion to the coordinate.
ROUGH = 1e-8

#: Relative displacement of coordinates in finite differences of π. These differences estimate the effect of rounding
#: errors of the state on π.
_SHARE = 1e-6

#: Numbers of steps for measurements of the order: 4, 6, 8, 12, 16, 24, … An order follows from the errors with n and 2n
#: steps. So the list contains 2n for every n except the last two.
_REFINEMENTS = tuple(f * 2**k for k in range(9) for f in (4, 6))


@dataclass(frozen=True)
class Observed:
    """Observed order of a method, with the errors from which it follows.

    ``order`` is the median of log₂(error with step h / error with step h/2) for the three smallest steps h in the
    asymptotic range. It is NaN if no steps are in this range. ``pairs`` lists step sizes with errors relative to the
    solution. ``floor`` is the error of the reference solution, or the rounding error if that is larger. ``exact`` says
    that all errors are so close to the floor that no order can be observed.
    """

    order: float
    pairs: tuple[tuple[float, float], ...]
    floor: float
    exact: bool = False


def observed_order(method: Method, reference: Callable[[float], tuple[Floats, float]], x: Floats, t: float) -> Observed:
    """Return the order that is observed from the errors at the time ``t`` with steps of t/4, t/6, t/8, …

    ``reference(t)`` returns the solution at the time t, and its relative error.
    """
    solution, uncertainty = reference(t)
    size = size_of(solution)
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
    # Errors near rounding, and errors of steps that are too large, do not follow the power law.
    usable = {n: e for n, e in errors.items() if 30 * floor < e < 0.02}
    slopes = [math.log2(e / usable[2 * n]) for n, e in usable.items() if 2 * n in usable]
    pairs = tuple((t / n, e) for n, e in errors.items())
    exact = bool(errors) and max(errors.values()) <= 30 * floor
    return Observed(float(np.median(slopes[-3:])) if slopes else math.nan, pairs, floor, exact)


def poisson_matrix(system: System, parameters: Mapping[str, float], x: Floats) -> Floats:
    """Return the matrix π(x), of shape (DIM, DIM), at the state ``x``."""
    values = {**parameters, **dict(zip(system.coordinates, x, strict=True))}
    return np.array([float(e) for e in evaluate([e for row in system.poisson for e in row], values)]).reshape(
        (len(x),) * 2
    )


def poisson_defect(system: System, parameters: Mapping[str, float], method: Method, x: Floats, h: float) -> float:
    """Return the largest entry of DΦ π DΦᵀ − π∘Φ for a step Φ, relative to the largest entry of |DΦ| |π| |DΦ|ᵀ.

    DΦ is computed by finite differences if the method has no tangent map. Rounding errors of the state change π by
    about Σ_i |x_i ∂_i π|, in units of the rounding error. If terms of π nearly cancel, this sum may be larger than |DΦ|
    |π| |DΦ|ᵀ. Then the result is relative to the sum.
    """
    tangent, image = method.tangent(x, h) if method.tangent else by_differences(method, x, h), method.step(x, h)
    start_tensor, end_tensor = (poisson_matrix(system, parameters, state) for state in (x, image))
    displaced_tensors = (poisson_matrix(system, parameters, image + _SHARE * part) for part in np.diag(image))
    felt = (
        sum(
            (np.abs(displaced_tensor - end_tensor) for displaced_tensor in displaced_tensors), np.zeros_like(end_tensor)
        )
        / _SHARE
    )
    size = max(float(np.max(np.abs(tangent) @ np.abs(start_tensor) @ np.abs(tangent).T)), float(np.max(felt)))
    return float(np.max(np.abs(tangent @ start_tensor @ tangent.T - end_tensor))) / (size or 1.0)


def tangent_error(method: Method, x: Floats, h: float) -> float:
    """Return the largest difference between the tangent map and finite differences of a step.

    The difference is relative to the largest entry of the tangent map. Several displacements are tried, and the
    smallest difference is returned, since no displacement suits all cases: near a singularity it must be small, and
    coordinates may differ widely in size. The result is 0 if the method has no tangent map.
    """
    if method.tangent is None:
        return 0.0
    tangent = method.tangent(x, h)
    apart = [float(np.max(np.abs(tangent - by_differences(method, x, h, finer)))) for finer in DISTANCES]
    if np.nanmin(apart) > ROUGH * float(np.max(np.abs(tangent))):
        apart.append(float(np.max(np.abs(tangent - by_differences(method, x, h, by_coordinate=True)))))
    return float(np.nanmin(apart)) / float(np.max(np.abs(tangent)))


def reversal(method: Method, x: Floats, h: float) -> float:
    """Return |Φ_{−h}(Φ_h(x)) − x|, relative to the largest coordinate, or absolute if x = 0."""
    return float(np.max(np.abs(method.after(h).step(method.step(x, h), -h) - x))) / size_of(x)


def largest_step(method: Method, states: Sequence[Floats], h: float, max_factor: float = 256.0) -> float:
    """Return the largest factor f, up to ``max_factor``, for which a step of size f·h succeeds from all states.

    The factor has an accuracy of 5 %. It is 0 if a step of size h/64 fails.
    """

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
    while high <= max_factor and works(high):
        low, high = high, 2 * high
    if high > max_factor:
        return low
    while high / low > 1.05:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if works(middle) else (low, middle)
    return low
