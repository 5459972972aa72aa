"""`solve_ivp` as users of SciPy know it, over a solver of phigen."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from phigen.errors import StepError
from phigen.runtime import arguments
from phigen.runtime.crossings import CrossingFinder
from phigen.runtime.ending import at_time
from phigen.runtime.interface import BackendError, Floats
from phigen.runtime.session import Session
from phigen.runtime.solver import Solver
from phigen.runtime.trajectory import Trajectory

if TYPE_CHECKING:
    from phigen.geometry.system import System

#: An event: a function of t and y (DIM,), with the attributes ``terminal`` and ``direction``, if it has them.
Event = Callable[[float, Floats], float]

#: Steps of the first attempt, where no step is given, and how often these are halved at most.
_FIRST, _HALVINGS = 64, 16

_REACHED = "The solver successfully reached the end of the integration interval."
_TERMINATED = "A termination event occurred."


@dataclass(frozen=True)
class OdeResult:
    """What `scipy.integrate.solve_ivp` gives: ``t`` (points,), ``y`` (DIM, points), ``sol``, a function of times or
    None, ``t_events`` and ``y_events``, arrays for each event, or None.

    ``status`` is 0 at the end of the interval, 1 at an event, -1 after a failure. ``h`` is the step,
    ``trajectory`` what was integrated, its times counted from 0 where the Hamiltonian does not depend on the time.
    """

    t: Floats
    y: Floats
    sol: Callable[[ArrayLike], Floats] | None
    t_events: list[Floats] | None
    y_events: list[Floats] | None
    status: int
    message: str
    h: float
    trajectory: Trajectory | None

    @property
    def success(self) -> bool:
        """Whether the end of the interval, or an event that ends it, was reached."""
        return self.status >= 0


#: Arguments of SciPy's that have no place here.
_SCIPY = {
    "method": "the method is that of the solver; order= changes its order",
    "jac": "the solver has its derivatives",
}
_SCIPY |= {"args": "parameters are keyword arguments", "vectorized": "solve_ivp calls no Python function"}
_SCIPY |= dict.fromkeys(["max_step", "first_step", "min_step"], "the step size is fixed: h=")


def solve_ivp(
    system: System | Solver | str | PathLike[str],
    t_span: Sequence[float],
    y0: ArrayLike,
    *,
    t_eval: ArrayLike | None = None,
    dense_output: bool = False,
    events: Event | Sequence[Event] | None = None,
    h: float | None = None,
    rtol: float = 1e-3,
    atol: float = 1e-6,
    order: int | None = None,
    target: str = "auto",
    parameters: Mapping[str, float] | None = None,
    **more: float,
) -> OdeResult:
    """Integrate from ``t_span[0]`` to ``t_span[1]``, with the arguments and the result of `scipy.integrate.solve_ivp`.

    ``system`` is in the place of the function: a spec, a `System`, or a `Solver`. Steps have one size, ``h`` (in τ with
    a monitor); without it they are halved until the last state changes by less than atol + rtol |y|. States between
    steps, at ``t_eval``, of ``sol`` and at ``events``, are those of further steps, on the leaf, not interpolated. A
    step that fails, and tolerances that are not reached, as by chaotic motion over long times, are told by ``status``.
    Raises `TypeError` for systems with noise: steps of other sizes are not on the same path.
    """
    solver = system if isinstance(system, Solver) else _compiled(system, target, order)
    for name in sorted(_SCIPY.keys() & more.keys() - {*solver.interface.parameters}):
        raise TypeError(f"solve_ivp has no {name!r} here: {_SCIPY[name]}")
    arguments.expect_no_noise("solve_ivp", solver.interface)
    begin, end = map(float, t_span)
    if not (math.isfinite(begin) and math.isfinite(end)) or begin == end:
        raise ValueError(f"t_span must be two different numbers, not {t_span!r}")
    wanted = None if t_eval is None else _times(t_eval, begin, end)
    values = {**(parameters or {}), **more}
    problem = _Problem(solver, begin, end, y0, values)
    try:
        step, converged = (math.copysign(h, end - begin), True) if h is not None else problem.chosen(rtol, atol)
        listed = [events] if callable(events) else list(events or [])
        found, stop = problem.events(listed, step)
        trajectory = problem.integrated(step, end if stop is None else stop)
    except StepError as error:
        given = error.trajectory if isinstance(error.trajectory, Trajectory) else None
        t = begin + given.t - problem.offset if given else np.empty(0)
        y = given.x.T if given else np.empty((solver.interface.dimension, 0))
        return OdeResult(t, y, None, None, None, -1, str(error), math.nan, given)
    last = end if stop is None else stop
    t = problem.offset + trajectory.t
    inside = None if wanted is None else wanted[(wanted - last) * (end - begin) <= 0]
    sol = problem.solution(trajectory)
    status, message = (0, _REACHED) if stop is None else (1, _TERMINATED)
    if not converged:
        status, message = -1, f"the states at the end still change by more than rtol and atol at steps of {step!r}"
    return OdeResult(
        t=t if inside is None else inside,
        y=trajectory.x.T if inside is None else sol(inside),
        sol=sol if dense_output else None,
        t_events=[np.array([t for t, _ in one]) for one in found] if events is not None else None,
        y_events=[np.array([x for _, x in one]) for one in found] if events is not None else None,
        status=status,
        message=message,
        h=step,
        trajectory=trajectory,
    )


@dataclass(frozen=True)
class _Problem:
    """A solver on an interval of time."""

    solver: Solver
    begin: float
    end: float
    y0: ArrayLike
    values: Mapping[str, float]

    @property
    def offset(self) -> float:
        """What is added to the times of the solver, which begin at 0 unless the Hamiltonian depends on them."""
        return 0.0 if self.solver.interface.time else self.begin

    def integrated(self, h: float, until: float, stride: int = 1) -> Trajectory:
        """The trajectory up to a time."""
        start: dict[str, Any] = {"t0": self.begin} if self.solver.interface.time else {}
        span = until - self.offset
        return self.solver.integrate(self.y0, h, until=span, stride=stride, parameters=self.values, **start)

    def chosen(self, rtol: float, atol: float) -> tuple[float, bool]:
        """A step at which the last state has stopped to change beyond the tolerances, and whether there is one."""
        h, before, failure = (self.end - self.begin) / _FIRST, None, None
        for _ in range(_HALVINGS):
            try:
                last = self.integrated(h, self.end, stride=np.iinfo(np.int64).max).x[-1]
            except StepError as error:
                failure, before = error, None
            else:
                if before is not None and (np.abs(last - before) <= atol + rtol * np.abs(last)).all():
                    return h, True
                before, failure = last, None
            h /= 2
        if failure:
            raise failure
        return 2 * h, False

    def events(self, listed: Sequence[Event], h: float) -> tuple[list[list[tuple[float, Floats]]], float | None]:
        """Times and states of each event up to the end, and the time of the one that ends the integration."""
        found = [self._crossings(event, h) for event in listed]
        sign, stops = math.copysign(1.0, self.end - self.begin), []
        for event, one in zip(listed, found, strict=True):
            count = int(getattr(event, "terminal", False) or 0)
            stops += [one[count - 1][0]] if 0 < count <= len(one) else []
        stop = min(stops, key=lambda t: sign * t) if stops else None
        last = self.end if stop is None else stop
        return [[(t, x) for t, x in one if (t - last) * sign <= 0] for one in found], stop

    def _crossings(self, event: Event, h: float) -> list[tuple[float, Floats]]:
        along = np.sign(getattr(event, "direction", 0)) * np.sign(
            self.end - self.begin
        )  # of time, not of the integration
        direction = {1: "rising", -1: "falling", 0: "both"}[int(along)]

        def g(states: Floats, t: Floats) -> Floats:
            return np.array([float(event(self.offset + at, x)) for at, x in zip(t.tolist(), states, strict=True)])

        t0 = self.begin if self.solver.interface.time else 0.0
        values = self.solver.values(self.values, {})
        start = arguments.state(self.y0, "y0", self.solver.interface)
        session = self.solver.backend.start(start, values, t0)
        steps = at_time(session, h, self.end - self.begin).steps + 1
        finder = CrossingFinder[Session](g, h, t0, timed=True, direction=direction)
        found = []
        try:
            for _, crossings in finder.follow(session, steps, lambda: session.advance(h, 1)):
                found += [(self.offset + t, x) for t, x in crossings]
        except BackendError as error:
            raise self.solver.failure(error, h, None, values) from error
        return found

    def solution(self, trajectory: Trajectory) -> Callable[[ArrayLike], Floats]:
        """The states (DIM,) at a time, (DIM, times) at many."""

        def sol(t: ArrayLike) -> Floats:
            given = np.asarray(t, dtype=np.float64)
            states = trajectory.at(np.atleast_1d(given) - self.offset).T
            return states[:, 0] if given.ndim == 0 else states

        return sol


def _compiled(system: System | str | PathLike[str], target: str, order: int | None) -> Solver:
    from phigen.api import compile

    solver = compile(system, target=target, order=order)
    if not isinstance(solver, Solver):
        raise TypeError("solve_ivp is for systems of coordinates; lattices have solver.integrate")
    return solver


def _times(t_eval: ArrayLike, begin: float, end: float) -> Floats:
    times = np.asarray(t_eval, dtype=np.float64)
    low, high = sorted((begin, end))
    if times.ndim != 1 or not ((times >= low) & (times <= high)).all():
        raise ValueError("t_eval must be times within t_span")
    if (np.diff(times) * (end - begin) <= 0).any():
        raise ValueError("t_eval must be sorted, in the direction of t_span")
    return times
