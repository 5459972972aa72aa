"""Motion of a monitored system in τ: the reference for its steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from phigen.runtime.solver import Solver
from phigen.study.methods import Method
from phigen.symbolic.arrays import Floats


def field_in_tau(solver: Solver, parameters: Mapping[str, float]) -> Callable[[Floats], Floats]:
    """Return the field g π∇H, the motion in τ for K = 0; dt/dτ is appended for states with the time as last
    coordinate."""
    n, backend = solver.interface.dimension, solver.backend

    def field(x: Floats) -> Floats:
        state = x[None, :n]
        rate = backend.rate(state, parameters)
        slope: Floats = np.append(rate * backend.vector_field(state, parameters)[0], rate)[: len(x)]
        return slope

    return field


def with_time(solver: Solver, parameters: Mapping[str, float], gauge: Floats) -> Method:
    """Return the method of a solver with fixed e and with the time as last coordinate of its rows."""
    fixed_gauge = Solver(solver.backend.with_gauge(gauge), solver.interface)

    def rows(x: Floats, h: float, steps: int, stride: int) -> Floats:
        trajectory = fixed_gauge.integrate(x[:-1], h, steps, stride, parameters=parameters)
        return np.column_stack([trajectory.x, trajectory.t])

    return Method(solver.target, lambda x, h: rows(x, h, 1, 1)[-1], rows)
