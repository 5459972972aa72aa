"""The solver users hold: checked arguments in, trajectories out, whatever the back end."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches

import numpy as np
from numpy.typing import ArrayLike

from phigen.errors import ParameterError, StepError
from phigen.runtime.backend import Backend
from phigen.runtime.crossings import CrossingFinder, Function, Section
from phigen.runtime.interface import BackendError, Floats, Interface, MissingExtraError, Progress, row_steps
from phigen.runtime.session import Session, rows_along
from phigen.runtime.trajectory import Trajectory

_ADVICE = {
    "NO_CONVERGENCE": "the inner iteration did not converge; a smaller step helps",
    "SINGULAR": "the inner equation is singular; a smaller step helps",
    "NOT_FINITE": "the state left the range of the formulas; a smaller step helps, unless the solution ends here",
}


class Solver:
    """A compiled system: ``solver.integrate(x0, h=0.05, steps=1000, stride=10, mass=2)``.

    Parameters of the system are keyword arguments; where a name clashes with an argument, or to pass many, give
    ``parameters={…}``. What is not given has its default of the spec. Wrong arguments raise `ValueError` or
    `TypeError`, a step that cannot be made `phigen.StepError`, parameters with which no step can be made, such as a
    zero that something is divided by, `phigen.ParameterError`, which is both. Safe to use from several threads.
    """

    def __init__(self, backend: Backend, interface: Interface) -> None:
        self.backend = backend
        self.interface = interface

    def __repr__(self) -> str:
        about = self.interface
        return f"<Solver {about.name}: order {about.order}, target {self.target}, ({', '.join(about.coordinates)})>"

    @property
    def target(self) -> str:
        """``c`` or ``numpy``."""
        return self.backend.target

    @property
    def order(self) -> int:
        """The order of the method."""
        return self.interface.order

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return self.interface.coordinates

    def integrate(
        self,
        x0: ArrayLike,
        h: float,
        steps: int,
        stride: int = 1,
        *,
        progress: Progress | None = None,
        parameters: Mapping[str, float] | None = None,
        **more: float,
    ) -> Trajectory:
        """Make ``steps`` steps of size ``h`` from ``x0`` (DIM,), storing every ``stride``-th state and the last.

        A negative ``h`` goes back in time. ``progress`` is called now and then with the number of steps done.
        Raises `StepError`, whose ``trajectory`` ends with the state before the failing step.
        """
        values = self._parameters(parameters, more)
        start, h = self._state(x0, "x0"), _step_size(h)
        steps, stride = _count(steps, "steps", 0), _count(stride, "stride", 1)
        try:
            states = rows_along(self.backend.start(start, values), h, steps, stride, progress)
        except BackendError as error:
            trajectory = self._trajectory(error.states, row_steps(error.step, stride), h, values)
            raise self.failure(error, h, trajectory, values) from error
        return self._trajectory(states, row_steps(steps, stride), h, values)

    def step(self, x: ArrayLike, h: float, *, parameters: Mapping[str, float] | None = None, **more: float) -> Floats:
        """The state (DIM,) one step of size ``h`` after ``x`` (DIM,); raises `StepError`."""
        values = self._parameters(parameters, more)
        start, h = self._state(x, "x"), _step_size(h)
        session = self._started(start, h, values)
        try:
            session.advance(h, 1)
        except BackendError as error:
            raise self.failure(error, h, None, values) from error
        return session.state()

    def step_tangent(
        self, x: ArrayLike, h: float, *, parameters: Mapping[str, float] | None = None, **more: float
    ) -> tuple[Floats, Floats]:
        """The state (DIM,) one step after ``x`` (DIM,), and its derivative (DIM, DIM), row i along the old coordinates.

        The derivative is exact to round-off; a gauge chosen by the solver is held fixed. Raises `StepError`, and
        `TypeError` if the solver was compiled without ``tangent=True``.
        """
        values = self._parameters(parameters, more)
        start, h = self._state(x, "x"), _step_size(h)
        session = self._started(start, h, values)
        tangent = self._with_tangent(session, h, values)
        return session.state(), tangent

    def tangents(
        self, x0: ArrayLike, h: float, steps: int, *, parameters: Mapping[str, float] | None = None, **more: float
    ) -> Iterator[tuple[Floats, Floats]]:
        """After each step of a trajectory, its state (DIM,) and the derivative (DIM, DIM) of that step.

        The steps are those of `integrate`. Raises what `step_tangent` does.
        """
        values = self._parameters(parameters, more)
        start, h, steps = self._state(x0, "x0"), _step_size(h), _count(steps, "steps", 0)
        session = self._started(start, h, values)
        for _ in range(steps):
            tangent = self._with_tangent(session, h, values)
            yield session.state(), tangent

    def section(
        self,
        x0: ArrayLike,
        h: float,
        steps: int,
        g: Function,
        *,
        progress: Progress | None = None,
        parameters: Mapping[str, float] | None = None,
        **more: float,
    ) -> Section:
        """Where ``g`` rises through zero along the trajectory of ``steps`` steps of size ``h`` from ``x0`` (DIM,).

        ``g`` takes states (rows, DIM) and gives (rows,). Each crossing is found to round-off by steps of the solver
        itself, from the state before it. A start with g = 0 counts if g rises from there. Raises `StepError`, whose
        ``trajectory`` is the `Section` so far.
        """
        values = self._parameters(parameters, more)
        start, h, steps = self._state(x0, "x0"), _step_size(h), _count(steps, "steps", 0)
        found: list[tuple[float, Floats]] = []
        finder = CrossingFinder[Session](g, h)
        try:
            session = self.backend.start(start, values)
            for _, crossings in finder.follow(session, steps, lambda: session.advance(h, 1)):
                found += crossings
                if progress:
                    progress(session.steps)
        except BackendError as error:
            raise self.failure(error, h, self._section(found), values) from error
        return self._section(found)

    def ensemble(
        self, X0: ArrayLike, h: float, steps: int, *, parameters: Mapping[str, float] | None = None, **more: float
    ) -> Floats:
        """Final states (members, DIM) of the initial states ``X0`` (members, DIM).

        Raises `StepError` if any member fails: its ``members`` are those that did, its ``trajectory`` the array of
        states (members, DIM) as far as each came.
        """
        values = self._parameters(parameters, more)
        start, h, steps = self._states(X0, "X0"), _step_size(h), _count(steps, "steps", 0)
        try:
            return self.backend.ensemble(start, h, steps, values)
        except BackendError as error:
            raise self.failure(error, h, error.states, values) from error

    def hamiltonian(self, x: ArrayLike, *, parameters: Mapping[str, float] | None = None, **more: float) -> Floats:
        """H of the states ``x`` (…, DIM), shape (…)."""
        states = self._array(x, "x")
        rows = states.reshape(-1, self.interface.dimension)
        return self.backend.hamiltonian(rows, self._parameters(parameters, more)).reshape(states.shape[:-1])

    def casimirs(
        self, x: ArrayLike, *, parameters: Mapping[str, float] | None = None, **more: float
    ) -> dict[str, Floats]:
        """The Casimirs of the states ``x`` (…, DIM), by name, each of shape (…)."""
        states = self._array(x, "x")
        rows = states.reshape(-1, self.interface.dimension)
        values = self.backend.casimirs(rows, self._parameters(parameters, more))
        return {name: values[:, i].reshape(states.shape[:-1]) for i, name in enumerate(self.interface.casimirs)}

    def vector_field(self, x: ArrayLike, *, parameters: Mapping[str, float] | None = None, **more: float) -> Floats:
        """π∇H at the states ``x`` (…, DIM), the same shape."""
        states = self._array(x, "x")
        rows = states.reshape(-1, self.interface.dimension)
        return self.backend.vector_field(rows, self._parameters(parameters, more)).reshape(states.shape)

    def _trajectory(self, x: Floats, stored: np.ndarray, h: float, parameters: dict[str, float]) -> Trajectory:
        casimirs = self.backend.casimirs(x, parameters)
        return Trajectory(
            t=h * stored,
            x=x,
            energy=self.backend.hamiltonian(x, parameters),
            casimirs={name: casimirs[:, i] for i, name in enumerate(self.interface.casimirs)},
            steps=int(stored[-1]),
            h=h,
            parameters=parameters,
            coordinates=self.interface.coordinates,
        )

    def _started(self, start: Floats, h: float, values: Mapping[str, float]) -> Session:
        try:
            return self.backend.start(start, values)
        except BackendError as error:
            raise self.failure(error, h, None, values) from error

    def _with_tangent(self, session: Session, h: float, values: Mapping[str, float]) -> Floats:
        try:
            return session.advance_tangent(h)
        except MissingExtraError:
            hint = "compile it with tangent=True, or say tangent: true in the spec"
            raise TypeError(f"{self.interface.name} was compiled without step_tangent; {hint}") from None
        except BackendError as error:
            raise self.failure(error, h, None, values) from error

    def _section(self, found: Sequence[tuple[float, Floats]]) -> Section:
        t, x = np.array([t for t, _ in found]), np.array([x for _, x in found])
        return Section(t, x.reshape(-1, self.interface.dimension), self.coordinates)

    def failure(
        self,
        error: BackendError,
        h: float,
        trajectory: Trajectory | Section | Floats | None,
        parameters: Mapping[str, float],
    ) -> StepError:
        """What the user is told of a failure in the back end, with his step, what was computed, and his parameters."""
        name = self.interface.name
        if error.status == "BAD_ARGUMENT":
            # The other arguments were checked.
            given = ", ".join(f"{name} = {value!r}" for name, value in parameters.items())
            message = f"{name}: no step can be made with {given}: what is computed from parameters alone is not finite"
            return ParameterError(message, step=0, status=error.status, trajectory=trajectory, members=error.members)
        where = f"{name}: step {error.step} of size {h!r} failed" if error.step >= 0 else f"{name}: a step failed"
        if error.members:
            shown = ", ".join(map(str, error.members[:5])) + (", …" if len(error.members) > 5 else "")
            where += f" for {len(error.members)} member(s) of the ensemble ({shown})"
        elif error.step >= 0 and isinstance(trajectory, Trajectory):
            where += f" at t = {error.step * h:.12g}"
        message = f"{where}: {error.status}" + (f", {_ADVICE[error.status]}" if error.status in _ADVICE else "")
        return StepError(message, step=error.step, status=error.status, trajectory=trajectory, members=error.members)

    def _parameters(self, given: Mapping[str, float] | None, more: Mapping[str, float]) -> dict[str, float]:
        known = self.interface.parameters
        both = sorted(set(given or {}) & set(more))
        if both:
            raise TypeError(f"parameter {both[0]!r} is given twice")
        values = {name: float(value) for name, value in known.items()}
        for name, value in {**(given or {}), **more}.items():
            if name not in known:
                raise TypeError(_unknown(name, known))
            values[name] = _number(value, f"parameter {name!r}")
            if name in self.interface.positive and values[name] <= 0:
                raise ValueError(f"parameter {name!r} must be positive, not {value!r}")
        return values

    def _state(self, x: ArrayLike, what: str) -> Floats:
        state = self._array(x, what)
        if state.ndim != 1:
            expected = f"({self.interface.dimension},)"
            raise ValueError(f"{what} must have shape {expected}, not {state.shape}; for many states use ensemble")
        return state

    def _states(self, x: ArrayLike, what: str) -> Floats:
        states = self._array(x, what)
        if states.ndim != 2:
            raise ValueError(f"{what} must have shape (members, {self.interface.dimension}), not {states.shape}")
        return states

    def _array(self, x: ArrayLike, what: str) -> Floats:
        if np.iscomplexobj(x):
            raise TypeError(f"{what} must be real")
        try:
            # A copy: what the caller does to his array later is his affair.
            states = np.array(x, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise TypeError(f"{what} must be an array of numbers: {error}") from None
        names = self.interface.coordinates
        if states.ndim == 0 or states.shape[-1] != len(names):
            last = f"{len(names)} ({', '.join(names)})"
            raise ValueError(f"{what} must have a last axis of length {last}, but its shape is {states.shape}")
        if not np.isfinite(states).all():
            index = tuple(np.argwhere(~np.isfinite(states))[0].tolist())
            place = f"{names[index[-1]]}" + (f" of member {index[0]}" if len(index) > 1 else "")
            raise ValueError(f"{what} must be finite, but {place} is {float(states[index])!r}")
        return states


def _unknown(name: str, known: Mapping[str, float]) -> str:
    near = get_close_matches(name, known, n=1)
    if near:
        return f"unknown parameter {name!r}; did you mean {near[0]!r}?"
    listed = f"the system has {', '.join(known)}" if known else "the system has none"
    return f"unknown parameter {name!r}; {listed}"


def _number(value: float, what: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{what} must be a number, not {value!r}") from None
    if not math.isfinite(number):
        raise ValueError(f"{what} must be finite, not {value!r}")
    return number


def _step_size(h: float) -> float:
    size = _number(h, "the step size h")
    if size == 0:
        raise ValueError("the step size h must not be 0")
    return size


def _count(value: int, what: str, minimum: int) -> int:
    try:
        count = operator.index(value)
    except TypeError:
        raise TypeError(f"{what} must be an integer, not {value!r}") from None
    if count < minimum:
        raise ValueError(f"{what} must be at least {minimum}, not {count}")
    return count
