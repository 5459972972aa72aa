"""Common interface of one-step methods for verification: generated solvers and classical methods."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from phigen.errors import StepError
from phigen.runtime.solver import Solver
from phigen.study import classical
from phigen.symbolic.arrays import Floats

#: Displacement for finite differences, relative to the state. Finite differences of order 6 then have an error of about
#: 1e-12.
_WIDTH = 2e-3
_WEIGHTS = ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))


@dataclass(frozen=True)
class Method:
    """One-step method: ``step(x, h)`` returns the state (DIM,) after a step.

    ``rows(x, h, steps, stride)`` returns the states (rows, DIM) of a run. If a step fails, ``step`` and ``rows`` raise
    `StepError`. ``tangent(x, h)`` returns the tangent map (DIM, DIM) of a step, if the code has one. ``step`` and
    ``rows`` begin at a fixed time; ``later(h)`` returns the method that begins later by h, if the equations depend on
    the time. ``together(states, h)`` makes one step from many states (members, DIM) at once, if possible.
    """

    name: str
    step: Callable[[Floats, float], Floats]
    rows: Callable[[Floats, float, int, int], Floats]
    tangent: Callable[[Floats, float], Floats] | None = None
    later: Callable[[float], Method] | None = None
    together: Callable[[Floats, float], Floats] | None = None

    def steps(self, states: Floats, h: float) -> Floats:
        """Return the states (members, DIM) after one step from each of the ``states`` (members, DIM)."""
        return self.together(states, h) if self.together else np.array([self.step(x, h) for x in states])

    def after(self, h: float) -> Method:
        """Return this method with its initial time increased by h; the same object if nothing depends on the time."""
        return self.later(h) if self.later else self


def of_solver(solver: Solver, parameters: Mapping[str, float], gauge: Floats | None = None, t0: float = 0.0) -> Method:
    """Return the method of a generated solver with its parameters, for steps that begin at the time ``t0``.

    Some solvers choose constants at the initial state: multiples of Casimirs, or the energy level e = −H(x₀). If
    ``gauge`` states these constants, all steps are the same map, whatever the initial state.
    """
    fixed_gauge = solver if gauge is None else Solver(solver.backend.with_gauge(gauge), solver.interface)
    begin = t0 if solver.interface.time else None

    def together(states: Floats, h: float) -> Floats:
        return fixed_gauge.ensemble(states, h, 1, t0=begin, parameters=parameters)

    return Method(
        solver.target,
        lambda x, h: fixed_gauge.step(x, h, t0=begin, parameters=parameters),
        lambda x, h, steps, stride: fixed_gauge.integrate(x, h, steps, stride, t0=begin, parameters=parameters).x,
        lambda x, h: fixed_gauge.step_tangent(x, h, t0=begin, parameters=parameters)[1],
        (lambda h: of_solver(solver, parameters, gauge, t0 + h)) if solver.interface.time else None,
        # With noise, members of an ensemble have different increments. So the ensemble cannot replace single steps.
        together if solver.target == "numpy" and not solver.interface.noise else None,
    )


def without_noise(solver: Solver, parameters: Mapping[str, float], t0: float = 0.0) -> Method:
    """Return the method of a generated solver with all increments of the noise set to 0."""
    begin, draws = t0 if solver.interface.time else None, solver.interface.draws

    def rows(x: Floats, h: float, steps: int, stride: int) -> Floats:
        zero_increments = np.zeros((steps, draws))
        return solver.integrate(x, h, steps, stride, t0=begin, increments=zero_increments, parameters=parameters).x

    return Method(solver.target, lambda x, h: rows(x, h, 1, 1)[-1], rows)


def field_of(solver: Solver, parameters: Mapping[str, float]) -> Callable[[Floats], Floats]:
    """Return the vector field of a solver as a function of one state (DIM,), without checks of the argument.

    If the vector field depends on the time, the time is the last coordinate of the state, (DIM + 1,); see `extended`.
    """
    if solver.interface.time:
        return lambda x: np.append(solver.backend.vector_field(x[None, :-1], parameters, x[-1:])[0], 1.0)

    def field(x: Floats) -> Floats:
        slope: Floats = solver.backend.vector_field(x[None, :], parameters)[0]
        return slope

    return field


def extended(solver: Solver, x: Floats, t0: float) -> Floats:
    """Return the state ``x``, with the time ``t0`` appended if the equations depend on the time, for `field_of`."""
    return np.append(x, t0) if solver.interface.time else x


def of_classical(
    name: str,
    solver: Solver,
    parameters: Mapping[str, float],
    t0: float = 0.0,
    vector_field: Callable[[Floats], Floats] | None = None,
) -> Method:
    """Return the classical method ``name`` for the vector field of a solver, or for ``vector_field`` if it is given."""
    field = vector_field or field_of(solver, parameters)

    def rows(x: Floats, h: float, steps: int, stride: int) -> Floats:
        states = classical.integrate(name, field, extended(solver, x, t0), h, steps, stride)[:, : len(x)]
        if not np.isfinite(states).all():
            raise StepError(f"the state of {name} became infinite or NaN", step=0, status="NOT_FINITE")
        return states

    def step(x: Floats, h: float) -> Floats:
        image: Floats = rows(x, h, 1, 1)[-1]
        return image

    later = (lambda h: of_classical(name, solver, parameters, t0 + h, vector_field)) if solver.interface.time else None
    return Method(name, step, rows, later=later)


def size_of(x: Floats) -> float:
    """Return the largest absolute value in ``x``, which is the unit of errors of a state; 1 if all entries are 0."""
    return float(np.max(np.abs(x))) or 1.0


def by_differences(method: Method, x: Floats, h: float, finer: float = 1.0, *, by_coordinate: bool = False) -> Floats:
    """Return the derivative (DIM, DIM) of a step by central differences of order 6.

    A coordinate is displaced in proportion to its size. If another coordinate is more than ten times larger, the
    displacement is in proportion to a tenth of the largest coordinate. With ``by_coordinate`` each nonzero coordinate
    is displaced in proportion to its own size, which suits, for example, momenta of small masses. ``finer`` divides
    displacements.
    """
    size = size_of(x)
    widths = _WIDTH / finer * np.where(x == 0, 0.1 * size, np.maximum(np.abs(x), 0.0 if by_coordinate else 0.1 * size))
    moves = [k * width * row for row, width in zip(np.eye(len(x)), widths, strict=True) for k, _ in _WEIGHTS]
    ahead, behind = (method.steps(x + sign * np.array(moves), h) for sign in (1, -1))
    weights = np.array([weight for _, weight in _WEIGHTS])
    differences = (ahead - behind).reshape(len(x), len(weights), len(x))
    slopes: Floats = (weights[:, np.newaxis] * differences).sum(axis=1) / widths[:, np.newaxis]
    return slopes.T
