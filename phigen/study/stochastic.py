"""Measurements of steps with noise: the strong order, and the number of steps that fail with the largest increments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from phigen.errors import StepError
from phigen.runtime.solver import Solver
from phigen.scheme.program import MAX_NORMAL_VARIATE
from phigen.study.methods import size_of
from phigen.symbolic.arrays import Floats

#: PATHS: number of Wiener paths. LEVELS: number of step sizes h, h/2, h/4, …. BEYOND: number of further halvings for
#: the reference solution. SEED: seed of the paths.
PATHS, LEVELS, BEYOND, SEED = 48, 5, 2, 1
#: Number of steps that are tried from one state. In these steps, increments of the noise have the largest possible size
#: and random signs.
SIGNS = 8
#: Errors up to this fraction of the state count as rounding errors. Methods whose steps are exact had errors of 1e-16
#: to 1e-14.
PATH_ROUNDING = 1e-12


def strong_order(
    solver: Solver, x0: Floats, parameters: Mapping[str, float], t0: float, h: float, steps: int, paths: int = PATHS
) -> float:
    """Return the strong order of a solver.

    Errors at the end of a run are measured with the steps h, h/2, h/4, … along the same Wiener paths. The strong order
    is the power of the step size with which these errors decrease. An increment of a coarse step is the sum of the
    increments of the fine steps inside it. Reference solutions follow the piecewise linear interpolation of a path, use
    only the vector fields, and converge to the Stratonovich solution. ``steps`` is the number of steps of size h along
    a path.
    """
    draws, finest = solver.interface.draws, steps << (LEVELS + BEYOND)
    begin = t0 if solver.interface.time else None
    random = np.random.default_rng(SEED)
    sources = len(solver.interface.noise)
    fine = random.normal(size=(paths, finest, draws)) * np.sqrt(abs(h) * steps / finest * sources / draws)
    fine_ends = _along_lines(solver, np.tile(x0, (paths, 1)), parameters, t0, h * steps / finest, fine)
    errors = np.zeros(LEVELS)
    for level in range(LEVELS):
        step_count = steps << level
        for path, end in zip(fine, fine_ends, strict=True):
            coarse = path.reshape(step_count, draws // sources, -1, sources).sum(axis=2).reshape(step_count, draws)
            arguments: dict[str, Any] = {"t0": begin, "increments": coarse, "parameters": parameters}
            errors[level] += np.sum(
                (solver.integrate(x0, h / 2**level, step_count, step_count, **arguments).x[-1] - end) ** 2
            )
    return observed_power(np.sqrt(errors / fine_ends.size), size_of(fine_ends))


def observed_power(errors: Floats, size: float) -> float:
    """Return the power of the step size with which ``errors`` (LEVELS,) decrease. Each step size is half of the one
    before.

    The power is infinite if an error is 0, or if all errors are rounding errors of states of the given ``size``.
    """
    if not errors.all() or errors.max() <= PATH_ROUNDING * size:
        return np.inf
    return float(-np.polyfit(np.arange(LEVELS), np.log2(errors), 1)[0])


def _along_lines(
    solver: Solver, x: Floats, parameters: Mapping[str, float], t0: float, h: float, increments: Floats
) -> Floats:
    """Return the last states (paths, DIM) of solutions that begin at ``x`` (paths, DIM) and follow piecewise linear
    Wiener paths.

    Each path is linear during a step of size h, and one RK4 step advances the solution by this time. ``increments``
    (paths, steps, draws) are the increments of the paths.
    """
    backend, timed = solver.backend, bool(solver.interface.time)
    sources = len(solver.interface.noise)

    def push(state: Floats, dw: Floats, t: float) -> Floats:
        when = np.full(len(state), t) if timed else None
        spread = np.einsum("ps,psd->pd", dw, backend.noise_fields(state, parameters, when))
        displacement: Floats = h * backend.vector_field(state, parameters, when) + spread
        return displacement

    for k in range(increments.shape[1]):
        dw, t = increments[:, k].reshape(len(x), -1, sources).sum(axis=1), t0 + k * h
        first = push(x, dw, t)
        second = push(x + first / 2, dw, t + h / 2)
        third = push(x + second / 2, dw, t + h / 2)
        x = x + (first + 2 * second + 2 * third + push(x + third, dw, t + h)) / 6
    return x


def failures(solver: Solver, states: Sequence[Floats], parameters: Mapping[str, float], t0: float, h: float) -> int:
    """Make steps with the largest possible increments of the noise, and return the number of steps that fail.

    `SIGNS` steps are made from each of the ``states``. The signs of the increments are random.
    """
    draws, begin = solver.interface.draws, t0 if solver.interface.time else None
    random, failed = np.random.default_rng(SEED), 0
    for x in states:
        for _ in range(SIGNS):
            size = np.sqrt(abs(h) * len(solver.interface.noise) / draws)
            largest = MAX_NORMAL_VARIATE * size * random.choice([-1.0, 1.0], size=(1, draws))
            try:
                solver.integrate(x, h, 1, t0=begin, increments=largest, parameters=parameters)
            except StepError:
                failed += 1
    return failed
