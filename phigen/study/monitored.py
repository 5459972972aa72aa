"""Motion of a system with a monitor g in the time τ, where dt = g dτ: a reference for steps of equal size in τ."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from phigen.runtime.solver import Solver
from phigen.study.methods import Method
from phigen.symbolic.arrays import Floats


def field_in_tau(solver: Solver, parameters: Mapping[str, float]) -> Callable[[Floats], Floats]:
    """Return the vector field g π∇H of the motion in τ, as a function of a state (DIM,).

    For a state (DIM + 1,) whose last coordinate is the time t, dt/dτ = g is appended.
    """
    n, backend = solver.interface.dimension, solver.backend

    def field(x: Floats) -> Floats:
        state = x[None, :n]
        rate = backend.rate(state, parameters)
        slope: Floats = np.append(rate * backend.vector_field(state, parameters)[0], rate)[: len(x)]
        return slope

    return field


def with_time(solver: Solver, parameters: Mapping[str, float], gauge: Floats) -> Method:
    """Return the method of a solver with a monitor. In the states of the method, the time t is the last coordinate.

    ``gauge`` has the energy level e. All steps use this e, so that they are the same map.
    """
    fixed_gauge = Solver(solver.backend.with_gauge(gauge), solver.interface)

    def rows(x: Floats, h: float, steps: int, stride: int) -> Floats:
        trajectory = fixed_gauge.integrate(x[:-1], h, steps, stride, parameters=parameters)
        return np.column_stack([trajectory.x, trajectory.t])

    return Method(solver.target, lambda x, h: rows(x, h, 1, 1)[-1], rows)
