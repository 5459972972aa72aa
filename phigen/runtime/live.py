"""Caller-driven stepping: sessions in which the caller makes the steps, and may change the state between two steps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from phigen.errors import StepError
from phigen.runtime import arguments
from phigen.runtime.arguments import Beginning
from phigen.runtime.interface import BackendError, Clock, Floats
from phigen.runtime.lattice_course import LatticeCourse
from phigen.runtime.session import Session
from phigen.runtime.trajectory import turned_into

if TYPE_CHECKING:
    from phigen.runtime.lattice import LatticeSession, LatticeSolver
    from phigen.runtime.solver import Solver


class LiveSession:
    """A trajectory that the caller advances step by step, made by `Solver.session`.

    Properties of its present state are ``x`` (DIM,), ``t``, ``steps``, ``energy``, ``casimirs`` and ``observables`` (by
    name), ``attitude`` and ``position`` (None without ``reconstruct``). `step` makes steps. `kick` and assignment to
    ``x`` change the state, but not the gauge (the multiples of Casimirs that are subtracted from H). `set_parameters`
    changes parameters. With a monitor, each of these changes sets the energy level e to −H of the present state.
    ``copy()`` returns an independent session. A session that was pickled and loaded continues bit for bit.
    """

    def __init__(
        self, solver: Solver | LatticeSolver, session: Session, parameters: Mapping[str, float], t0: float
    ) -> None:
        self.solver: Any = solver
        self.parameters = dict(parameters)
        self._session = session
        self._clock = Clock(t0)
        self._put = session.state()

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.solver.interface.name}: t = {self.t!r}, {self.steps} steps>"

    @property
    def x(self) -> Floats:
        """A copy of the state (DIM,). Assignment replaces the state; `leaf` then returns the Casimirs of the new
        state."""
        return self._session.state()

    @x.setter
    def x(self, value: ArrayLike) -> None:
        self._move(self._session.place, self._checked(value, "x"))

    def kick(self, change: ArrayLike) -> Self:
        """Add ``change`` (DIM,) to the state, as an impulse does, and return the session.

        From then on, the property `leaf` returns the Casimirs of the new state.
        """
        self._move(self._session.kick, self._checked(change, "change"))
        return self

    def set_parameters(self, parameters: Mapping[str, float] | None = None, /, **by_keyword: float) -> Self:
        """Replace parameters, and return the session; state, time, attitude and random numbers are unchanged.

        Raises `TypeError` for unknown names, and `ValueError` for values that are not admissible; then no parameter
        changes.
        """
        changes = arguments.together(parameters, by_keyword)
        values = self.solver.values({**self.parameters, **changes}, {})
        begin = Clock(self.t, self._clock.h, self.steps)
        try:
            self._session.set_parameters(values)
        except BackendError as error:
            raise self.solver.failure(error, math.nan, None, values) from error
        self._go_on(values, begin)
        return self

    def _go_on(self, values: dict[str, Any], begin: Clock) -> None:
        """Store new parameters. Without a monitor, also store the clock ``begin``, which counts the time from
        now on.
        """
        self.parameters = values
        if not self.solver.interface.monitored:
            self._clock = begin

    def step(self, h: float, steps: int = 1) -> Self:
        """Make ``steps`` steps of size ``h`` (in the rescaled time τ if the spec has a monitor), and return the
        session.

        Raises `StepError`; the session then has the state before the failing step.
        """
        h, steps = arguments.step_size(h), arguments.count(steps, "steps", 0)
        if not self.solver.interface.monitored:
            self._clock.set_step(h, self.steps)
        try:
            self._session.advance(h, steps)
        except BackendError as error:
            raise self.solver.failure(error, h, None, self.parameters) from error
        return self

    @property
    def steps(self) -> int:
        """The number of steps since the start."""
        return self._session.steps

    @property
    def t(self) -> float:
        """The physical time t of the present state."""
        if self.solver.interface.monitored:
            return self._clock.t + self._session.time()
        return self._clock.after(self.steps)

    @property
    def energy(self) -> float:
        """The value of H at the state."""
        row = self.x[np.newaxis]
        return float(self.solver.energies(row, np.array([self.t]), self.parameters)[0])

    @property
    def casimirs(self) -> dict[str, float]:
        """The Casimirs of the state, by name."""
        return self._casimirs_of(self.x)

    @property
    def observables(self) -> dict[str, float]:
        """The observables of the spec at the state, by name."""
        values = self.solver.observed(self.x[np.newaxis], np.array([self.t]), self.parameters)[0].tolist()
        return dict(zip(self.solver.interface.observables, values, strict=True))

    @property
    def leaf(self) -> dict[str, float]:
        """The Casimirs of the initial state, or of the state after the last kick or assignment to x, by name."""
        return self._casimirs_of(self._put)

    @property
    def attitude(self) -> Floats | None:
        """The attitude, a quaternion (4,) or a matrix (n, n); None if the solver has no ``reconstruct``."""
        return None if (rows := self._element()[0]) is None else rows[0]

    @property
    def position(self) -> Floats | None:
        """The position (3,); None if the spec reconstructs none."""
        return None if (rows := self._element()[1]) is None else rows[0]

    def copy(self) -> LiveSession:
        """Return an independent copy of the session."""
        twin = object.__new__(LiveSession)
        twin.__dict__.update(self.__dict__)
        twin.parameters, twin._session = dict(self.parameters), self._session.branch()
        twin._clock = replace(self._clock)
        return twin

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_session": self._session.saved()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._session = self.solver.backend.restored(state["_session"], self.parameters)

    def _checked(self, value: ArrayLike, argument: str) -> Floats:
        return arguments.state(value, argument, self.solver.interface)

    def _casimirs_of(self, x: Floats) -> dict[str, float]:
        casimirs = self.solver.casimirs(x, parameters=self.parameters)
        return {name: float(value) for name, value in casimirs.items()}

    def _element(self) -> tuple[Floats | None, Floats | None]:
        return turned_into(self.solver.interface, self._session.element()[np.newaxis])

    def _move(self, by: Any, values: Floats) -> None:
        try:
            by(values)
        except BackendError as error:
            cause = "or the monitor not positive there" if self.solver.interface.monitored else "since it is too large"
            name = self.solver.interface.name
            raise StepError(
                f"{name}: the state is not finite, {cause}", step=self.steps, status=error.status
            ) from error
        self._put = self.x


class LiveLattice(LiveSession):
    """A trajectory of a lattice that the caller advances step by step, made by `LatticeSolver.session`.

    ``x`` has the shape (coordinates, *sizes), and a Casimir of each site is an array (*sizes). Methods and properties
    are those of `LiveSession`. The cost of a step, a kick or a copy is proportional to the number of sites.
    """

    def __init__(self, solver: LatticeSolver, beginning: Beginning) -> None:
        super().__init__(solver, cast("Session", LatticeCourse(solver, beginning)), beginning.values, beginning.t0)

    def set_parameters(self, parameters: Mapping[str, Any] | None = None, /, **by_keyword: Any) -> Self:
        """Replace parameters by numbers or arrays, and return the session.

        The state, the time and the random numbers are unchanged. The session continues like a session that starts at
        the present state: compensation terms and predictors are dropped. Raises `TypeError`, `ValueError` and
        `StepError` for names and values that are not admissible; then nothing changes.
        """
        changes = arguments.together(parameters, by_keyword)
        if "bonds" in changes:
            raise TypeError("the bonds of a session are fixed: start another session at x, with t0")
        values = self.solver.values({**self.parameters, **changes}, {}, self._put.shape[1:])
        begin = Clock(self.t, self._clock.h, self.steps)
        cast("LatticeCourse", self._session).set_parameters(values)
        self._go_on(values, begin)
        return self

    @property
    def energy(self) -> float:
        """The value of H at the state."""
        return self._sites.hamiltonian()

    @property
    def observables(self) -> dict[str, Any]:
        """The observables of the spec at the state, by name. Observables with a value at each site are arrays (*sizes),
        all others are numbers.
        """
        interface, sites = self.solver.interface, self._sites
        numbers = dict(zip(interface.observables, sites.observables().tolist(), strict=True))
        return numbers | dict(zip(interface.observed_fields, sites.observed_fields(), strict=True))

    def copy(self) -> LiveLattice:
        """Return an independent copy of the session."""
        twin = object.__new__(LiveLattice)
        branch = cast("LatticeCourse", self._session).branch()
        twin.__dict__.update(self.__dict__, _session=branch, parameters=dict(self.parameters))
        twin._clock = replace(self._clock)
        return twin

    def __getstate__(self) -> dict[str, Any]:
        return dict(self.__dict__)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)

    @property
    def _sites(self) -> LatticeSession:
        return cast("LatticeCourse", self._session).sites

    def _checked(self, value: ArrayLike, argument: str) -> Floats:
        x: Floats = self.solver.state(value, argument)
        if x.shape != self._put.shape:
            raise ValueError(f"{argument} must have shape {self._put.shape}, not {x.shape}")
        return x

    def _casimirs_of(self, x: Floats) -> dict[str, Any]:
        casimirs: dict[str, Any] = self.solver.casimirs(x, parameters=self.parameters)
        return casimirs

    def _element(self) -> tuple[None, None]:
        return None, None
