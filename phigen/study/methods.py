"""One-step methods as verification sees them: generated solvers and classical methods behind one set of functions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from phigen.errors import StepError
from phigen.runtime.solver import Solver
from phigen.study import classical
from phigen.symbolic.arrays import Floats

#: The offset of differences in units of the state; with formulas of order 6 their error is about 1e-12.
_WIDTH = 2e-3
_WEIGHTS = ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))


@dataclass(frozen=True)
class Method:
    """``step(x, h)`` maps states (DIM,), ``rows(x, h, steps, stride)`` gives (rows, DIM); both raise `StepError`.

    ``tangent(x, h)`` is the derivative (DIM, DIM) of a step that the code itself states, None if it states none. All
    begin at one time; ``later(h)`` is the method that begins later. ``together`` makes one step of many members.
    """

    name: str
    step: Callable[[Floats, float], Floats]
    rows: Callable[[Floats, float, int, int], Floats]
    tangent: Callable[[Floats, float], Floats] | None = None
    later: Callable[[float], Method] | None = None
    together: Callable[[Floats, float], Floats] | None = None

    def steps(self, states: Floats, h: float) -> Floats:
        """Return the ends of a step from each of the states (members, DIM)."""
        return self.together(states, h) if self.together else np.array([self.step(x, h) for x in states])

    def after(self, h: float) -> Method:
        """The method for what begins so much later."""
        return self.later(h) if self.later else self


def of_solver(solver: Solver, parameters: Mapping[str, float], gauge: Floats | None = None, t0: float = 0.0) -> Method:
    """A generated solver; with a ``gauge``, all steps are those of one map, whatever they start from."""
    fixed = solver if gauge is None else Solver(solver.backend.with_gauge(gauge), solver.interface)
    begin = t0 if solver.interface.time else None

    def together(states: Floats, h: float) -> Floats:
        return fixed.ensemble(states, h, 1, t0=begin, parameters=parameters)

    return Method(
        solver.target,
        lambda x, h: fixed.step(x, h, t0=begin, parameters=parameters),
        lambda x, h, steps, stride: fixed.integrate(x, h, steps, stride, t0=begin, parameters=parameters).x,
        lambda x, h: fixed.step_tangent(x, h, t0=begin, parameters=parameters)[1],
        (lambda h: of_solver(solver, parameters, gauge, t0 + h)) if solver.interface.time else None,
        # members of an ensemble draw their own noise
        together if solver.target == "numpy" and not solver.interface.noise else None,
    )


def without_noise(solver: Solver, parameters: Mapping[str, float], t0: float = 0.0) -> Method:
    """A generated solver whose increments of the noise are all 0."""
    begin, draws = t0 if solver.interface.time else None, solver.interface.draws

    def rows(x: Floats, h: float, steps: int, stride: int) -> Floats:
        still = np.zeros((steps, draws))
        return solver.integrate(x, h, steps, stride, t0=begin, increments=still, parameters=parameters).x

    return Method(solver.target, lambda x, h: rows(x, h, 1, 1)[-1], rows)


def field_of(solver: Solver, parameters: Mapping[str, float]) -> Callable[[Floats], Floats]:
    """The vector field of a solver at one state (DIM,), without the checks that the public method makes each time.

    Where it depends on the time, that is one more coordinate, the last: see `extended`.
    """
    if solver.interface.time:
        return lambda x: np.append(solver.backend.vector_field(x[None, :-1], parameters, x[-1:])[0], 1.0)

    def field(x: Floats) -> Floats:
        slope: Floats = solver.backend.vector_field(x[None, :], parameters)[0]
        return slope

    return field


def extended(solver: Solver, x: Floats, t0: float) -> Floats:
    """The state that `field_of` starts from."""
    return np.append(x, t0) if solver.interface.time else x


def of_classical(
    name: str,
    solver: Solver,
    parameters: Mapping[str, float],
    t0: float = 0.0,
    vector_field: Callable[[Floats], Floats] | None = None,
) -> Method:
    """A classical method on the vector field of a solver, or on ``vector_field`` instead."""
    field = vector_field or field_of(solver, parameters)

    def rows(x: Floats, h: float, steps: int, stride: int) -> Floats:
        states = classical.integrate(name, field, extended(solver, x, t0), h, steps, stride)[:, : len(x)]
        if not np.isfinite(states).all():
            raise StepError(f"{name} left the finite numbers", step=0, status="NOT_FINITE")
        return states

    def step(x: Floats, h: float) -> Floats:
        image: Floats = rows(x, h, 1, 1)[-1]
        return image

    later = (lambda h: of_classical(name, solver, parameters, t0 + h, vector_field)) if solver.interface.time else None
    return Method(name, step, rows, later=later)


def by_differences(method: Method, x: Floats, h: float, finer: float = 1.0, *, by_coordinate: bool = False) -> Floats:
    """The derivative (DIM, DIM) of a step by central differences of order 6, at so many times smaller distances.

    These are of the size of the state or, ``by_coordinate``, of each coordinate, as momenta of small masses ask for.
    """
    size = float(np.max(np.abs(x))) or 1.0
    widths = _WIDTH / finer * np.where(x == 0, 0.1 * size, np.maximum(np.abs(x), 0.0 if by_coordinate else 0.1 * size))
    moves = [k * width * row for row, width in zip(np.eye(len(x)), widths, strict=True) for k, _ in _WEIGHTS]
    ahead, behind = (method.steps(x + sign * np.array(moves), h) for sign in (1, -1))
    weights = np.array([weight for _, weight in _WEIGHTS])
    differences = (ahead - behind).reshape(len(x), len(weights), len(x))
    slopes: Floats = (weights[:, np.newaxis] * differences).sum(axis=1) / widths[:, np.newaxis]
    return slopes.T
