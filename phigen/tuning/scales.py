"""Scales of the search for settings: the time span over which methods are measured, and the largest useful step."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from phigen.runtime.backend import Backend
from phigen.study.methods import size_of
from phigen.symbolic.arrays import Floats
from phigen.tuning.problem import Candidate, Problem, steps_in
from phigen.tuning.timing import nanoseconds_per_step

#: Each method is measured over a part of the run of the spec. The part is as long as n steps with the step size of the
#: spec. PIECE_SECONDS: processor time, in seconds, of n steps with the method of the spec. PIECE_STEPS: largest n; the
#: least n is 500.
PIECE_STEPS, PIECE_SECONDS = 20_000, 0.02
#: MOST_TURN: largest angle by which a step may rotate the fastest oscillation, since fewer than about three steps per
#: period do not resolve it. LEAST_STEPS: least number of steps of a run.
MOST_TURN, LEAST_STEPS = 2.0, 24
#: DENSE: largest dimension for which all eigenvalues of the Jacobian matrix are computed. In higher dimensions, a
#: vector is multiplied FOLLOWED times by the Jacobian matrix. The mean growth of the vector per multiplication, without
#: the first SETTLING ones, is slightly less than the largest modulus of an eigenvalue.
DENSE, SETTLING, FOLLOWED = 256, 8, 16


def scales(problem: Problem, method: Candidate) -> tuple[float, float]:
    """Return the time span over which candidates are measured, and the largest step that resolves the motion.

    ``method`` is the method that the spec states; its speed determines the time span.
    """
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
    """Return the vector field of a solver as a function of states (rows, DIM).

    With a monitor, the vector field is that of the motion in τ, for steps of equal size in τ.
    """

    def slope(x: Floats) -> Floats:
        velocity: Floats = solver.vector_field(x, parameters)
        return solver.rate(x, parameters)[:, np.newaxis] * velocity if monitored else velocity

    return slope


def fastest_rate(field: Callable[[Floats], Floats], states: Floats) -> float:
    """Return the largest |λ| at several states, where λ are the eigenvalues of the derivative of a vector field.

    ``states`` has the shape (rows, DIM). In high dimensions the result is an estimate.
    """
    size = size_of(states)
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
    """Return an estimate of the largest |λ| at the state ``x`` (DIM,), where λ are the eigenvalues of the Jacobian
    matrix of ``field``.

    The Jacobian matrix is applied repeatedly to a vector, by finite differences of size ``width``.
    """
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
