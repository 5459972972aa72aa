"""Lattices in NumPy: the solver and the sessions that call a generated module. `phigen.runtime.lattice` has the
protocols."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from phigen.memory import expect_room
from phigen.runtime.interface import (
    FIRST_DRAWS,
    BackendError,
    Clock,
    Draws,
    Floats,
    LatticeInterface,
    MissingExtraError,
)
from phigen.runtime.modules import load_module
from phigen.scheme.policies import StartPolicy


class NumpyLatticeSession:
    """A `phigen.runtime.lattice.LatticeSession` that makes its steps by calling functions of a generated NumPy
    module."""

    def __init__(
        self,
        module: Any,
        x0: Floats,
        parameters: Mapping[str, Any],
        t0: float,
        draws: Draws,
        *,
        timed: bool,
    ) -> None:
        self.steps = 0
        expect_room("the states before and after a sweep", 2 * x0.nbytes)
        self._module, self._x, self._timed = module, np.array(x0), timed
        self._clock, self._draws = Clock(t0), draws
        try:
            _, self._sites = module._started(x0, parameters, *([t0] if timed else []))
            module._coefficients(self._sites, StartPolicy().probe_step)
            self._begin()
        except ValueError:
            raise BackendError("BAD_ARGUMENT", 0, self._x[None]) from None
        self._sites.seed, self._sites.member = draws.seed, draws.member
        self._h = np.nan
        self._rows: Any = None
        self._tell_time()

    def _begin(self) -> None:
        """Set the energy level and the physical time of a lattice with a monitor.

        Raises `ValueError` if g ≤ 0 at the start.
        """
        if hasattr(self._module, "_begin"):
            self._module._begin(self._sites, self._x)

    def state(self) -> Floats:
        """Return a copy of the state (coordinates, *sizes)."""
        return self._x.copy()

    def advance(self, h: float, steps: int) -> None:
        """Make ``steps`` steps of size ``h``."""
        self.prepare(h)
        predictors: dict[Any, Any] = {}
        with np.errstate(all="ignore"):
            for _ in range(steps):
                try:
                    self._x = self._module._advance(self._sites, self._rows, self._x, predictors)
                except self._module.FailedError as failed:
                    raise BackendError(str(failed), self.steps, self._x[None].copy()) from None
                finally:
                    self._tell_time()
                self.steps += 1
                self._tell_time()

    def advance_tangent(self, h: float, vectors: Floats, steps: int = 1) -> Floats:
        """Make ``steps`` steps, and return the products of their derivative with the tangent ``vectors``."""
        if not hasattr(self._module, "step_tangent"):
            raise MissingExtraError("step_tangent")
        self.prepare(h)
        carried, predictors = list(vectors), dict[Any, Any]()
        with np.errstate(all="ignore"):
            for _ in range(steps):
                try:
                    self._x = self._module._advance(self._sites, self._rows, self._x, predictors, carried)
                    self._module._finite(np.array(carried))
                except self._module.FailedError as failed:
                    raise BackendError(str(failed), self.steps, self._x[None].copy()) from None
                finally:
                    self._tell_time()
                self.steps += 1
                self._tell_time()
        return np.array(carried).reshape(vectors.shape)

    def advance_along(self, h: float, increments: Floats) -> None:
        """Make one step for each row of ``increments`` (steps, parts, sources, *sizes).

        The increments replace the random increments of the noise.
        """
        try:
            for row in increments:
                self._sites.increments = row
                self.advance(h, 1)
        finally:
            self._sites.increments = None

    def prepare(self, h: float) -> None:
        """Compute the coefficients that depend on the step size. Raises `BackendError` if a coefficient is not
        finite."""
        if h != self._h:
            try:
                self._h, self._rows = h, self._module._coefficients(self._sites, h)
            except ValueError:  # raised if a coefficient is not finite; the C returns a status instead
                raise BackendError("NOT_FINITE", self.steps, self._x[None].copy()) from None
            self._clock.set_step(h, self.steps)

    def _tell_time(self) -> None:
        self._sites.step = self._draws.step + self.steps
        if self._timed:
            self._sites.t = self._clock.after(self.steps)

    def saved(self) -> dict[str, Any]:
        """Return the energy level and the physical time of a lattice with a monitor; else {}."""
        return {"passed": np.array([self._sites.level, *self._sites.clock])} if hasattr(self._sites, "level") else {}

    def time(self) -> float:
        """Return the physical time since the start, for a lattice with a monitor."""
        return float(sum(self._sites.clock))

    def hold(self, level: float) -> None:
        """Set the energy level e of a lattice with a monitor; by default e is −H of the initial state."""
        self._sites.level = level

    def resume(self, h: float, steps: int, arrays: Mapping[str, Any]) -> None:
        """Continue after ``steps`` steps of size h; ``arrays`` are the result of `saved`."""
        self.prepare(h)
        self.steps = steps
        if "passed" in arrays:
            self._sites.level, *clock = arrays["passed"].tolist()
            self._sites.clock = tuple(clock)
        self._tell_time()

    def place(self, x: Floats) -> None:
        """Replace the state by ``x`` (coordinates, *sizes).

        With a monitor, the energy level e becomes −H(x). Raises `BackendError` if x is not finite.
        """
        if not np.isfinite(x).all():
            raise BackendError("BAD_ARGUMENT", self.steps, self._x[None].copy())
        if hasattr(self._sites, "level"):
            try:
                self._sites.level = self._module._level(self._sites, x)
            except ValueError:
                raise BackendError("BAD_ARGUMENT", self.steps, self._x[None].copy()) from None
        self._x = np.array(x)

    def kick(self, change: Floats) -> None:
        """Add ``change`` (coordinates, *sizes) to the state. Raises `BackendError` if the sum is not finite."""
        with np.errstate(all="ignore"):
            self.place(self._x + change)

    def hamiltonian(self) -> float:
        """Return H of the state."""
        return float(self.density().sum())

    def density(self) -> Floats:
        """Return the density of H at the sites (*sizes)."""
        with np.errstate(all="ignore"):  # the result may contain NaN or infinity, without warnings
            return np.asarray(self._module._energy(self._sites.parameters, self._x, self._sites)[0])

    def casimirs(self) -> Floats:
        """Return the densities of the Casimirs (Casimirs, *sizes)."""
        return np.asarray(self._module._casimirs(self._sites.parameters, self._x, self._sites))

    def vector_field(self) -> Floats:
        """Return π∇H (coordinates, *sizes)."""
        return np.asarray(self._module._vector_field(self._sites.parameters, self._x, self._sites))

    def observables(self) -> Floats:
        """Return the observables that are one number each (observables,)."""
        if not hasattr(self._module, "_observables"):
            return np.empty(0)
        with np.errstate(all="ignore"):
            densities = self._module._observables(self._sites.parameters, self._x, self._sites)
            return np.asarray(self._module._reduced(densities, self._sites))

    def observed_fields(self) -> Floats:
        """Return the observables with a value at each site (fields, *sizes)."""
        if not hasattr(self._module, "_observed_fields"):
            return np.empty((0, *self._x.shape[1:]))
        with np.errstate(all="ignore"):
            return np.asarray(self._module._observed_fields(self._sites.parameters, self._x, self._sites))


class NumpyLattice:
    """Loaded solver of a lattice in NumPy (`phigen.runtime.lattice.LatticeBackend`), made from the text of a module."""

    target = "numpy"

    def __init__(self, files: Mapping[str, str], interface: LatticeInterface) -> None:
        self.interface, self._files = interface, dict(files)
        self._text = files[f"{interface.name}.py"]
        self._module = load_module(self._text, interface.name)

    def __reduce__(self) -> tuple[type[NumpyLattice], tuple[Any, ...]]:
        return NumpyLattice, (self._files, self.interface)

    @property
    def identity(self) -> str:
        """A hash of everything that determines the results."""
        return hashlib.sha256(f"{np.__version__}\n{self._text}".encode()).hexdigest()[:40]

    def threads(self, sites: int) -> int:
        """Return 1: NumPy uses one thread."""
        return 1

    def start(
        self, x0: Floats, parameters: Mapping[str, Any], t0: float = 0.0, draws: Draws = FIRST_DRAWS
    ) -> NumpyLatticeSession:
        """Return a session at x0 (coordinates, *sizes), at the time t0."""
        return NumpyLatticeSession(self._module, x0, parameters, t0, draws, timed=bool(self.interface.time))

    @property
    def has_pullback(self) -> bool:
        return hasattr(self._module, "pullback")

    def pullback(
        self,
        x0: Floats,
        h: float,
        steps: int,
        stride: int,
        bars: Floats,
        parameters: Mapping[str, Any],
        t0: float = 0.0,
    ) -> tuple[Floats, Floats, dict[str, Floats]]:
        if not self.has_pullback:
            raise MissingExtraError("pullback")
        stored_states = min(steps, 2 * math.isqrt(steps)) + 2 * len(bars)
        expect_room("the stored states of the reverse pass", stored_states * x0.nbytes)
        pulled_back: tuple[Floats, Floats, dict[str, Floats]]
        try:
            when = {"t0": t0} if self.interface.time else {}
            pulled_back = self._module.pullback(x0, h, steps, bars, stride, **when, **parameters)
        except self._module.StepError as error:
            raise BackendError(error.status, error.step, error.states) from None
        except ValueError:
            self.start(x0, parameters, t0).prepare(h)  # raises `BackendError` if a coefficient is not finite for this h
            raise BackendError("BAD_ARGUMENT", 0, x0[None]) from None
        return pulled_back
