"""A trajectory in the hands of its user: he makes the steps, and may move the state between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from phigen.errors import StepError
from phigen.runtime import arguments
from phigen.runtime.arguments import Beginning
from phigen.runtime.interface import BackendError, Clock, Floats
from phigen.runtime.session import Session
from phigen.runtime.trajectory import turned_into

if TYPE_CHECKING:
    from phigen.runtime.lattice import LatticeSession, LatticeSolver
    from phigen.runtime.solver import Solver


class LiveSession:
    """A trajectory that stands somewhere; `Solver.session` makes one.

    ``x`` (DIM,), ``t``, ``steps``, ``energy``, ``casimirs`` and ``observables`` (by name), ``attitude`` and
    ``position`` (None without ``reconstruct``) are those of the state; `step` goes on, `kick` and setting ``x`` move
    it. What the solver learnt on the way, and a gauge, stay; with a monitor e becomes −H of the new state. ``copy()``
    branches; sessions can be pickled, and go on to the last bit.
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
        """The state (DIM,), a copy; setting it moves the session there, onto the leaf of that state."""
        return self._session.state()

    @x.setter
    def x(self, value: ArrayLike) -> None:
        self._move(self._session.place, self._checked(value, "x"))

    def kick(self, change: ArrayLike) -> Self:
        """Move the state by ``change`` (DIM,), as an impulse does. Where that leaves the leaf, ``leaf`` follows."""
        self._move(self._session.kick, self._checked(change, "change"))
        return self

    def step(self, h: float, steps: int = 1) -> Self:
        """Make steps of size ``h``, in τ with a monitor. Raises `StepError`, and stands before the step that failed."""
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
        """Steps made since the start."""
        return self._session.steps

    @property
    def t(self) -> float:
        """The physical time."""
        if self.solver.interface.monitored:
            return self._clock.t + self._session.time()
        return self._clock.after(self.steps)

    @property
    def energy(self) -> float:
        """H of the state."""
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
        """The Casimirs of the leaf that the session was last put on: at the start, by setting x, or by a kick."""
        return self._casimirs_of(self._put)

    @property
    def attitude(self) -> Floats | None:
        """A quaternion (4,) or a matrix (n, n); None without ``reconstruct``."""
        return None if (found := self._element()[0]) is None else found[0]

    @property
    def position(self) -> Floats | None:
        """The position (3,); None without one."""
        return None if (found := self._element()[1]) is None else found[0]

    def copy(self) -> LiveSession:
        """An independent copy."""
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

    def _checked(self, value: ArrayLike, what: str) -> Floats:
        return arguments.state(value, what, self.solver.interface)

    def _casimirs_of(self, x: Floats) -> dict[str, float]:
        found = self.solver.casimirs(x, parameters=self.parameters)
        return {name: float(value) for name, value in found.items()}

    def _element(self) -> tuple[Floats | None, Floats | None]:
        return turned_into(self.solver.interface, self._session.element()[np.newaxis])

    def _move(self, by: Any, given: Floats) -> None:
        try:
            by(given)
        except BackendError as error:
            said = "or the monitor not positive there" if self.solver.interface.monitored else "too large"
            name = self.solver.interface.name
            raise StepError(f"{name}: the state is not finite, {said}", step=self.steps, status=error.status) from error
        self._put = self.x


class LiveLattice(LiveSession):
    """A lattice that stands somewhere; `LatticeSolver.session` makes one.

    ``x`` has the shape (coordinates, *sizes), and Casimirs of sites have one value for each. All else is as of
    `LiveSession`, and a step, a kick or a copy take work in proportion to the sites.
    """

    def __init__(self, solver: LatticeSolver, session: LatticeSession, at: Beginning) -> None:
        super().__init__(solver, cast("Session", session), at.values, at.t0)
        self._draws, self._before = at.draws, 0

    @property
    def steps(self) -> int:
        """Steps made since the start."""
        return self._before + self._session.steps

    @property
    def energy(self) -> float:
        """H of the state."""
        return self._lattice.hamiltonian()

    @property
    def observables(self) -> dict[str, Any]:
        """The observables of the spec at the state, by name: numbers, and arrays (*sizes) for those of sites."""
        about, session = self.solver.interface, self._lattice
        numbers = dict(zip(about.observables, session.observables().tolist(), strict=True))
        return numbers | dict(zip(about.observed_fields, session.observed_fields(), strict=True))

    def copy(self) -> LiveLattice:
        """An independent copy."""
        twin = object.__new__(LiveLattice)
        twin.__setstate__(self.__getstate__())
        return twin

    def __getstate__(self) -> dict[str, Any]:
        kept = {"_session": (self._session.state(), self._lattice.saved()), "_made": self.steps}
        return {**self.__dict__, "parameters": dict(self.parameters), "_clock": replace(self._clock), **kept}

    def __setstate__(self, state: dict[str, Any]) -> None:
        x, saved = state["_session"]
        made = state.pop("_made")
        self.__dict__.update(state)
        # counted from where the size of the step was set: with the same times and random numbers
        clock, self._before = self._clock, self._clock.counted
        draws = replace(self._draws, step=self._draws.step + self._before)
        self._session = self.solver.started(Beginning(x, clock.h, self.parameters, clock.t, draws))
        if clock.h:
            self._lattice.resume(clock.h, made - self._before, saved)

    @property
    def _lattice(self) -> LatticeSession:
        return cast("LatticeSession", self._session)

    def _checked(self, value: ArrayLike, what: str) -> Floats:
        found: Floats = self.solver.state(value, what)
        if found.shape != self._put.shape:
            raise ValueError(f"{what} must have shape {self._put.shape}, not {found.shape}")
        return found

    def _casimirs_of(self, x: Floats) -> dict[str, Any]:
        found: dict[str, Any] = self.solver.casimirs(x, parameters=self.parameters)
        return found

    def _element(self) -> tuple[None, None]:
        return None, None
