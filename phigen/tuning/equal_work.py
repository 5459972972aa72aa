"""Comparison of a solver with RK4 at the same cost: the largest energy error of RK4 over the same run."""

from __future__ import annotations

import math

import numpy as np

from phigen.compilation import Compilation
from phigen.runtime.backend import Backend
from phigen.tuning.problem import Classical, Problem, steps_in
from phigen.tuning.timing import nanoseconds_per_step

#: Approximate number of states of a run at which the energy is evaluated.
ROWS = 2000


def rk4_energy_error(compilation: Compilation, solver: Backend, problem: Problem) -> float:
    """Return the energy error of a run by RK4 that takes as much processor time as the run of the solver.

    RK4 works in double precision. The result is infinite if RK4 breaks down, and NaN if steps cannot be timed. Raises
    `ToolchainError` if the C compiler fails.
    """
    state = problem.start.copy()
    rk4 = Classical(problem.classical(compilation, ["rk4"], state).runners["rk4"], state, problem)
    steps = steps_in(problem.horizon, problem.step)
    cost = nanoseconds_per_step(problem.method(solver), problem.step, steps)
    ratio = nanoseconds_per_step(rk4, problem.step, steps) / cost
    if not math.isfinite(ratio):
        return math.nan
    steps = steps_in(problem.horizon, problem.step * ratio)
    states = rk4.rows(problem.horizon / steps, steps, max(1, steps // ROWS))
    if states is None or not np.isfinite(states).all():
        return math.inf
    energies = problem.energies(states)
    error = float(np.max(problem.unit.errors(energies, float(energies[0]))))
    return error if math.isfinite(error) else math.inf
