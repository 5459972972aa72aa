"""The scales of a search: the time span over which methods are measured, and the largest useful step."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from phigen.runtime.backend import Backend
from phigen.symbolic.arrays import Floats
from phigen.tuning.problem import Candidate, Problem, steps_in
from phigen.tuning.timing import nanoseconds_per_step

#: Limits of a scan: number of steps of the run's size, and seconds of processor time.
PIECE_STEPS, PIECE_SECONDS = 20_000, 0.02
#: Largest angle by which a step may rotate the fastest motion: fewer than three steps a turn do not resolve it. Least
#: number of steps.
MOST_TURN, LEAST_STEPS = 2.0, 24
#: Largest dimension at which all eigenvalues are computed. Above it, the growth of one vector is measured between
#: SETTLING and FOLLOWED applications of the derivative; the result is somewhat below the largest eigenvalue.
DENSE, SETTLING, FOLLOWED = 256, 8, 16


def scales(problem: Problem, method: Candidate) -> tuple[float, float]:
    """Return the time span over which candidates are scanned, and the largest step that resolves the motion."""
    h = problem.step
    scan_steps = steps_in(min(problem.horizon, 500 * h), h)
    states = method.rows(h, scan_steps, max(1, scan_steps // 16))
    if states is None:
        return problem.horizon, problem.horizon / LEAST_STEPS
    nanoseconds = nanoseconds_per_step(method, h, scan_steps)
    steps = min(max(1e9 * PIECE_SECONDS / nanoseconds, 500), PIECE_STEPS)
    rate = fastest_rate(motion(method.solver, problem.parameters, monitored=problem.clock == "τ"), states)
    return min(problem.horizon, steps * h), min(MOST_TURN / max(rate, 1e-300), problem.horizon / LEAST_STEPS)


def motion(solver: Backend, parameters: Mapping[str, Any], *, monitored: bool) -> Callable[[Floats], Floats]:
    """Return the vector field at states (rows, DIM), per unit of the variable in which steps are equal: τ or t."""

    def slope(x: Floats) -> Floats:
        velocity: Floats = solver.vector_field(x, parameters)
        return solver.rate(x, parameters)[:, np.newaxis] * velocity if monitored else velocity

    return slope


def fastest_rate(field: Callable[[Floats], Floats], states: Floats) -> float:
    """Return the largest absolute eigenvalue of the derivative of the vector field at some states (rows, DIM)."""
    size = float(np.max(np.abs(states))) or 1.0
    width, rate = 1e-6 * size, 0.0
    for x in states:
        if len(x) > DENSE:
            rate = max(rate, _growth(field, x, width))
            continue
        moves = width * np.eye(len(x))
        jacobian = (field(x + moves) - field(x - moves)).T / (2 * width)
        if np.isfinite(jacobian).all():
            rate = max(rate, float(np.max(np.abs(np.linalg.eigvals(jacobian)))))
    return rate


def _growth(field: Callable[[Floats], Floats], x: Floats, width: float) -> float:
    """Return an estimate of the largest absolute eigenvalue at a state (DIM,), by powers of the derivative."""
    v, log = np.random.default_rng(0).normal(size=len(x)), 0.0
    for k in range(FOLLOWED):
        displacement = width * v / np.max(np.abs(v))
        ahead, behind = field(np.array([x + displacement, x - displacement]))
        w = (ahead - behind) / (2 * width)
        size = float(np.linalg.norm(w)) / float(np.linalg.norm(v / np.max(np.abs(v))))
        if not np.isfinite(size) or size == 0:
            return 0.0
        log += math.log(size) if k >= SETTLING else 0.0
        v = w
    return math.exp(log / (FOLLOWED - SETTLING))
