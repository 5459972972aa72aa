"""Integrations of lattices. An integration can be copied. A copy is needed to locate a crossing, to repeat a step in
smaller steps, and to end a run or store a row inside a step.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from phigen.runtime.arguments import Beginning
from phigen.runtime.interface import BackendError, Clock, Floats
from phigen.runtime.retrying import Retrying
from phigen.runtime.session import Followed

if TYPE_CHECKING:
    from phigen.runtime.lattice import LatticeSession, LatticeSolver


#: Number of steps for which copies of an integration share one saved state. Saving a state of 64 sites takes as long as
#: some twenty steps.
SHARED_STEPS = 16


class LatticeCourse:
    """A lattice being integrated (`phigen.runtime.session.Followed`), with the state (coordinates, *sizes).

    A copy made by `branch`, or an integration restored from `saved`, continues with the same bits as an uninterrupted
    integration. Sections make a copy at every step, but use only a few copies. So a copy starts its session on first
    use, from a saved state that copies share for up to `SHARED_STEPS` steps. At its start, the session repeats the
    steps since the saved state.
    """

    def __init__(self, solver: LatticeSolver, beginning: Beginning) -> None:
        self.solver, self.at = solver, beginning
        self._arrays: Mapping[str, Any] = {}
        self._sites: LatticeSession | None = solver.started(beginning)
        self._clock, self._before = Clock(beginning.t0), 0
        self._ahead = 0  # number of steps to be repeated from the saved arrays when the session is started
        self._anchor: Mapping[str, Any] = {}  # saved arrays that copies share; {} after a change of step size or state
        self._anchor_steps = 0

    @property
    def sites(self) -> LatticeSession:
        """The session that makes the steps. If there is no session yet, one is started from the saved arrays."""
        if self._sites is None:
            # The session begins at the last change of the step size, from which times and random numbers are counted.
            arrays, clock, steps_before = self._arrays, self._clock, self._before
            draws = replace(self.at.draws, step=self.at.draws.step + steps_before)
            begin = Beginning(np.asarray(arrays["state"]), clock.h, self.at.values, clock.t, draws)
            self._sites = self.solver.started(begin)
            if clock.h:
                self._sites.resume(clock.h, int(arrays["counts"][1]) - steps_before, arrays)
            elif "passed" in arrays:
                self._sites.hold(float(arrays["passed"][0]))
            if self._ahead:
                self._sites.advance(clock.h, self._ahead)
            self._arrays, self._ahead = {}, 0
        return self._sites

    @property
    def steps(self) -> int:
        """The number of successful steps since the start."""
        if self._sites is None:
            return int(self._arrays["counts"][1]) + self._ahead
        return self._before + self._sites.steps

    @property
    def rounding(self) -> float:
        return float(np.finfo(np.float32 if self.solver.interface.single else np.float64).eps)

    def state(self) -> Floats:
        """A copy of the state (coordinates, *sizes)."""
        return self.sites.state()

    def time(self) -> float:
        """The physical time since the start for a lattice with a monitor; else NaN."""
        return self.sites.time() if self.solver.interface.monitored else math.nan

    def element(self) -> Floats:
        """Return an empty array, since lattices have no attitude."""
        return np.empty(0)

    def advance(self, h: float, steps: int) -> None:
        """Make ``steps`` steps of size ``h``."""
        sites = self.sites  # started before h changes, since its start may repeat earlier steps
        earlier_h = self._clock.h
        if h != earlier_h:
            self._anchor = {}
            self._clock.set_step(h, self.steps)
        try:
            sites.advance(h, steps)
        except BackendError:
            if self.steps == self._clock.counted:
                # No step of size h succeeded. A copy of this session starts with the step size of the clock.
                self._clock.h = earlier_h
            raise

    def branch(self) -> LatticeCourse:
        """Return an independent copy. Until its first use, the copy consists of saved arrays, which several copies
        share.
        """
        steps = self.steps
        if not (self._anchor and 0 <= steps - self._anchor_steps < SHARED_STEPS):
            self._anchor, self._anchor_steps = self.saved(), steps
        twin, clock = object.__new__(LatticeCourse), self._clock
        twin.solver, twin.at, twin._before = self.solver, self.at, clock.counted
        twin._clock = Clock(clock.t, clock.h, clock.counted)  # the clock at the saved state
        twin._arrays, twin._sites, twin._ahead = self._anchor, None, steps - self._anchor_steps
        twin._anchor, twin._anchor_steps = {}, 0
        return twin

    def place(self, x: Floats) -> None:
        """Replace the state by ``x`` (coordinates, *sizes).

        With a monitor, the energy level e becomes −H(x). Raises `BackendError` if x is not finite.
        """
        self._anchor = {}
        self.sites.place(x)

    def kick(self, change: Floats) -> None:
        """Add ``change`` (coordinates, *sizes) to the state. Raises `BackendError` if the sum is not finite."""
        self._anchor = {}
        self.sites.kick(change)

    def set_parameters(self, values: Mapping[str, Any]) -> None:
        """Replace the parameters. The state, the time and the random numbers are unchanged.

        Compensation terms and predictors are dropped, as at a new start. With a monitor, the energy level e becomes −H
        of the state. Raises `StepError` if no step is possible with the parameters.
        """
        sites, steps, draws = self.sites, self.steps, self.at.draws
        clock = Clock(self._clock.after(steps), self._clock.h, steps)
        beginning = Beginning(sites.state(), clock.h, values, clock.t, replace(draws, step=draws.step + steps))
        changed = self.solver.started(beginning)
        if self.solver.interface.monitored:
            level, time = changed.saved()["passed"][:1], sites.saved()["passed"][1:]
            changed.resume(clock.h, 0, {"passed": np.concatenate([level, time])})
        self.at = replace(self.at, values=values)
        self._sites, self._clock, self._before, self._anchor = changed, clock, steps, {}

    def saved(self) -> dict[str, Any]:
        """Return the arrays from which `restored` recreates the state of this integration."""
        if self._sites is None and not self._ahead:
            return dict(self._arrays)
        sites, clock = self.sites, self._clock
        counts = np.array([clock.counted, self.steps])
        return {"state": self.state(), "clock": np.array([clock.t, clock.h]), "counts": counts, **sites.saved()}

    @classmethod
    def restored(cls, solver: LatticeSolver, beginning: Beginning, arrays: Mapping[str, Any]) -> LatticeCourse:
        """Return the integration that `saved` stored as ``arrays``; ``beginning`` are the arguments with which the
        integration began.
        """
        course = object.__new__(cls)
        course.__setstate__({"solver": solver, "at": beginning, "saved": arrays})
        return course

    def __getstate__(self) -> dict[str, Any]:
        return {"solver": self.solver, "at": self.at, "saved": self.saved()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.solver, self.at, arrays = state["solver"], state["at"], state["saved"]
        (t, h), (steps_before, _) = arrays["clock"].tolist(), arrays["counts"].tolist()
        self._clock, self._before = Clock(t, h, steps_before), steps_before
        self._arrays, self._sites, self._ahead = arrays, None, 0
        self._anchor, self._anchor_steps = {}, 0


class ObservedCourse(Retrying):
    """An integration whose method `state` returns the observables of the spec, an array (observables,).

    Functions of observables define the section of a run and, by the key ``stop``, its end. A failing step is repeated
    as several smaller steps, see `Retrying`.
    """

    def state(self) -> Floats:
        """Return the values of the observables at the present state, (observables,)."""
        return self.sites.observables()

    @property
    def sites(self) -> LatticeSession:
        """The session of the lattice, from which the state of all sites can be read."""
        return cast("LatticeCourse", self.session).sites

    def saved(self) -> dict[str, Any]:
        """Return the arrays from which `restored` recreates the state of this integration."""
        parts = np.array([self._extra, *self.retried])
        return {**cast("LatticeCourse", self.session).saved(), "parts": parts}

    @classmethod
    def begun(cls, solver: LatticeSolver, beginning: Beginning, retry: int = 0) -> ObservedCourse:
        """Return a new integration at its start; a failing step is halved at most ``retry`` times."""
        return cls(cast("Followed", LatticeCourse(solver, beginning)), retry)

    @classmethod
    def restored(
        cls, solver: LatticeSolver, beginning: Beginning, retry: int, arrays: Mapping[str, Any]
    ) -> ObservedCourse:
        """Return the integration that `saved` stored as ``arrays``; ``beginning`` are the arguments with which the
        integration began.
        """
        course = cls(cast("Followed", LatticeCourse.restored(solver, beginning, arrays)), retry)
        course._extra, *course.retried = arrays["parts"].tolist()
        return course
