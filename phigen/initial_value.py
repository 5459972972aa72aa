"""The function `solve_ivp`, which integrates by a solver of phigen. Its arguments and its result are those of
`scipy.integrate.solve_ivp`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from phigen.api import compile
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

#: An event as in SciPy: a function of t and y (DIM,) whose zeros are located. It may have the attributes ``terminal``
#: and ``direction``.
Event = Callable[[float, Floats], float]

#: For calls without a step ``h``: number of steps of the first attempt, and largest number of attempts. Each further
#: attempt halves the step size.
_FIRST_STEPS, _MAX_HALVINGS = 64, 16

_REACHED = "The solver successfully reached the end of the integration interval."
_TERMINATED = "A termination event occurred."


@dataclass(frozen=True)
class OdeResult:
    """Result of `solve_ivp`, with the fields of SciPy's result.

    ``t`` (points,) are the times and ``y`` (DIM, points) the states. ``sol`` is a function of times, or None.
    ``t_events`` and ``y_events`` are lists with one array for each event, or None. ``status`` is 0 at the end of the
    interval, 1 at an event, −1 after a failure. ``h`` is the step size. ``trajectory`` is the integrated trajectory;
    its times begin at 0 if the Hamiltonian does not depend on the time.
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
        """Whether the end of the interval, or a terminal event, was reached."""
        return self.status >= 0


#: Arguments of SciPy's solve_ivp that are refused → the reason, for the error message.
_SCIPY = {
    "method": "the solver determines the method; order= changes its order",
    "jac": "phigen derives all derivatives itself",
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

    ``system`` replaces SciPy's function: a spec, a `System`, or a `Solver`. All steps have the size ``h``; with a
    monitor, which rescales time by dt = g dτ, ``h`` is a step in τ. Without ``h``, the step is halved until the last
    state changes by less than atol + rtol |y|. States between steps, for ``t_eval``, ``events`` and ``sol``, are made
    by further steps rather than by interpolation, so they have the Casimirs of the trajectory.

    ``status`` is −1 if a step fails, or if the tolerances are not reached, as for chaotic motion over a long time.
    Raises `TypeError` for systems with noise, since steps of different sizes do not follow one path of the noise.
    """
    solver = system if isinstance(system, Solver) else _compiled(system, target, order)
    for name in sorted(_SCIPY.keys() & more.keys() - {*solver.interface.parameters}):
        raise TypeError(f"solve_ivp has no {name!r} here: {_SCIPY[name]}")
    arguments.expect_no_noise("solve_ivp", solver.interface)
    begin, end = map(float, t_span)
    if not (math.isfinite(begin) and math.isfinite(end)) or begin == end:
        raise ValueError(f"t_span must be two different numbers, not {t_span!r}")
    requested_times = None if t_eval is None else _checked_times(t_eval, begin, end)
    values = {**(parameters or {}), **more}
    problem = _Problem(solver, begin, end, y0, values)
    try:
        step, converged = (math.copysign(h, end - begin), True) if h is not None else problem.chosen(rtol, atol)
        event_list = [events] if callable(events) else list(events or [])
        crossings, stop = problem.events(event_list, step)
        trajectory = problem.integrated(step, end if stop is None else stop)
    except StepError as error:
        partial = error.trajectory if isinstance(error.trajectory, Trajectory) else None
        t = begin + partial.t - problem.offset if partial else np.empty(0)
        y = partial.x.T if partial else np.empty((solver.interface.dimension, 0))
        return OdeResult(t, y, None, None, None, -1, str(error), math.nan, partial)
    last = end if stop is None else stop
    t = problem.offset + trajectory.t
    times_inside = None if requested_times is None else requested_times[(requested_times - last) * (end - begin) <= 0]
    sol = problem.solution(trajectory)
    status, message = (0, _REACHED) if stop is None else (1, _TERMINATED)
    if not converged:
        status, message = -1, f"the states at the end still change by more than rtol and atol at steps of {step!r}"
    return OdeResult(
        t=t if times_inside is None else times_inside,
        y=trajectory.x.T if times_inside is None else sol(times_inside),
        sol=sol if dense_output else None,
        t_events=[np.array([t for t, _ in event_crossings]) for event_crossings in crossings]
        if events is not None
        else None,
        y_events=[np.array([x for _, x in event_crossings]) for event_crossings in crossings]
        if events is not None
        else None,
        status=status,
        message=message,
        h=step,
        trajectory=trajectory,
    )


@dataclass(frozen=True)
class _Problem:
    """Initial value problem: a solver, the time interval from ``begin`` to ``end``, the initial state, and
    parameters.
    """

    solver: Solver
    begin: float
    end: float
    y0: ArrayLike
    values: Mapping[str, float]

    @property
    def offset(self) -> float:
        """The number that is added to a time of the solver to get a time of the user.

        The number is 0 if the Hamiltonian depends on the time. Otherwise times of the solver begin at 0, and the number
        is ``begin``.
        """
        return 0.0 if self.solver.interface.time else self.begin

    def integrated(self, h: float, until: float, stride: int = 1) -> Trajectory:
        """Return the trajectory from the beginning of the interval to the time ``until``, in steps of size ``h``."""
        start: dict[str, Any] = {"t0": self.begin} if self.solver.interface.time else {}
        span = until - self.offset
        return self.solver.integrate(self.y0, h, until=span, stride=stride, parameters=self.values, **start)

    def chosen(self, rtol: float, atol: float) -> tuple[float, bool]:
        """Return a step size, and whether it reaches the tolerances.

        The step size is halved until a halving changes the last state by no more than the tolerances. If this never
        happens, the result is the smallest step size that was tried, and False. Raises `StepError` if the last attempt
        fails.
        """
        h, previous, failure = (self.end - self.begin) / _FIRST_STEPS, None, None
        for _ in range(_MAX_HALVINGS):
            try:
                last = self.integrated(h, self.end, stride=np.iinfo(np.int64).max).x[-1]
            except StepError as error:
                failure, previous = error, None
            else:
                if previous is not None and (np.abs(last - previous) <= atol + rtol * np.abs(last)).all():
                    return h, True
                previous, failure = last, None
            h /= 2
        if failure:
            raise failure
        return 2 * h, False

    def events(self, event_list: Sequence[Event], h: float) -> tuple[list[list[tuple[float, Floats]]], float | None]:
        """Return the times and states of each event, and the time at which a terminal event ends the integration.

        Events after this time are left out. The second result is None if no terminal event occurs.
        """
        by_event = [self._crossings(event, h) for event in event_list]
        sign, stops = math.copysign(1.0, self.end - self.begin), []
        for event, event_crossings in zip(event_list, by_event, strict=True):
            count = int(getattr(event, "terminal", False) or 0)
            stops += [event_crossings[count - 1][0]] if 0 < count <= len(event_crossings) else []
        stop = min(stops, key=lambda t: sign * t) if stops else None
        last = self.end if stop is None else stop
        return [[(t, x) for t, x in event_crossings if (t - last) * sign <= 0] for event_crossings in by_event], stop

    def _crossings(self, event: Event, h: float) -> list[tuple[float, Floats]]:
        """Return the times and states at which an event changes its sign in the direction of its attribute
        ``direction``.
        """
        direction_of_change = np.sign(getattr(event, "direction", 0)) * np.sign(
            self.end - self.begin
        )  # SciPy counts the direction along the integration, CrossingFinder along increasing time.
        direction = {1: "rising", -1: "falling", 0: "both"}[int(direction_of_change)]

        def g(states: Floats, t: Floats) -> Floats:
            return np.array(
                [float(event(self.offset + elapsed, x)) for elapsed, x in zip(t.tolist(), states, strict=True)]
            )

        t0 = self.begin if self.solver.interface.time else 0.0
        values = self.solver.values(self.values, {})
        start = arguments.state(self.y0, "y0", self.solver.interface)
        session = self.solver.backend.start(start, values, t0)
        steps = at_time(session, h, self.end - self.begin).steps + 1
        finder = CrossingFinder[Session](g, h, t0, timed=True, direction=direction)
        crossings_so_far = []
        try:
            for _, crossings in finder.follow(session, steps, lambda: session.advance(h, 1)):
                crossings_so_far += [(self.offset + t, x) for t, x in crossings]
        except BackendError as error:
            raise self.solver.failure(error, h, None, values) from error
        return crossings_so_far

    def solution(self, trajectory: Trajectory) -> Callable[[ArrayLike], Floats]:
        """Return the function ``sol`` of SciPy's result. For a time it returns a state (DIM,), for times the states
        (DIM, times).
        """

        def sol(t: ArrayLike) -> Floats:
            times = np.asarray(t, dtype=np.float64)
            states = trajectory.at(np.atleast_1d(times) - self.offset).T
            return states[:, 0] if times.ndim == 0 else states

        return sol


def _compiled(system: System | str | PathLike[str], target: str, order: int | None) -> Solver:
    solver = compile(system, target=target, order=order)
    if not isinstance(solver, Solver):
        raise TypeError("solve_ivp is for systems of coordinates; lattices have solver.integrate")
    return solver


def _checked_times(t_eval: ArrayLike, begin: float, end: float) -> Floats:
    times = np.asarray(t_eval, dtype=np.float64)
    low, high = sorted((begin, end))
    if times.ndim != 1 or not ((times >= low) & (times <= high)).all():
        raise ValueError("t_eval must be times within t_span")
    if (np.diff(times) * (end - begin) <= 0).any():
        raise ValueError("t_eval must be sorted, in the direction of t_span")
    return times
