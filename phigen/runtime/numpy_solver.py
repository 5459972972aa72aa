"""A generated NumPy module, loaded from its source text.

Beside the documented functions, sessions use the parts of ``integrate``: ``_values``, ``_admissible``,
``_coefficients``, ``_renewed`` where there is a time, ``_advance``, with tangents ``_tangent_stage``, with a monitor
``_time_of``, and with attitudes what ``reconstruct`` uses; so do ensembles, see `phigen.runtime.numpy_members`.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from phigen.runtime.interface import (
    FIRST_DRAWS,
    BackendError,
    Draws,
    Floats,
    Interface,
    LatticeInterface,
    MissingExtraError,
)
from phigen.runtime.members import Members
from phigen.runtime.modules import load_module
from phigen.runtime.numpy_lattice import NumpyLattice
from phigen.runtime.numpy_members import ensemble

Pair = tuple[Floats, Floats]
#: Coefficients, parameters and step of a stage, and its time where there is one: passed on to the module.
Stage = tuple[Any, ...]

#: A stage, its start (state and carry), and what it solved for.
Made = tuple[Stage, Floats, Floats, Floats]


class Turned(NamedTuple):
    """An attitude on its way: the element it began with, and when; the product of all steps, what rounding took of
    that, and the rate of Casimirs."""

    first: Floats
    begun: float
    element: Floats
    lost: Floats
    rate: Floats | None

    def arrays(self) -> dict[str, Any]:
        """What a session saves."""
        rate = np.empty(0) if self.rate is None else self.rate
        return {"first": self.first, "begun": self.begun, "element": self.element, "lost": self.lost, "rate": rate}

    @classmethod
    def from_arrays(cls, stored: Mapping[str, Any]) -> Turned:
        """The inverse of `arrays`."""
        rate = stored["rate"] if stored["rate"].size else None
        return cls(stored["first"], float(stored["begun"]), stored["element"], stored["lost"], rate)


class NumpySession:
    """What the loop of the module's ``integrate`` holds. See `phigen.runtime.session.Session`."""

    def __init__(
        self,
        module: Any,
        parameters: Mapping[str, float],
        x: Floats,
        carry: Floats,
        gauge: Floats | None,
        t0: float = 0.0,
        draws: Draws = FIRST_DRAWS,
    ) -> None:
        self.steps, self._draws = 0, draws
        # The time and the steps when the size of the step was set: the time is counted from there, without adding up.
        self._t, self._counted = t0, 0
        self._module, self._parameters, self._gauge = module, parameters, gauge
        self._renewed = hasattr(module, "_renewed")
        self._x, self._carry = x, carry
        self._passed = (np.zeros(len(x)),) * 2  # physical time, where steps are equal in tau, and its carry
        self._h = np.nan
        self._stages: list[Stage] = []
        self._memory: list[Pair] = []
        self._turned: Turned | None = None

    def state(self) -> Floats:
        """See `Session`."""
        return np.array(self._x[0])

    @property
    def rounding(self) -> float:
        """See `Session`."""
        return float(np.finfo(float).eps)

    def time(self) -> float:
        """See `Session`."""
        return float((self._passed[0] + self._passed[1])[0]) if hasattr(self._module, "_time_of") else np.nan

    def placed(self, x: Floats) -> NumpySession:
        """See `Session`."""
        copy = self.branch()
        copy._x = x[np.newaxis].copy()
        return copy

    def place(self, x: Floats) -> None:
        """See `Session`."""
        self._stand(x[np.newaxis].copy(), np.zeros((1, len(x))))

    def kick(self, change: Floats) -> None:
        """See `Session`."""
        self._stand(*self._module._sum(self._x, self._carry, change[np.newaxis]))

    def _stand(self, x: Floats, carry: Floats) -> None:
        """Guesses, which are offsets from the state, move with it."""
        monitored = hasattr(self._module, "_refused")
        if not np.isfinite(x).all() or (monitored and len(self._module._refused(self._values(), x))):
            raise BackendError("BAD_ARGUMENT", self.steps, self._x.copy())
        element = None if self._turned is None else self.element()
        self._x, self._carry = x, carry
        if monitored:  # e = -H
            self._gauge = self._module.gauge(x[0], **self._parameters)
            if np.isfinite(self._h):
                self._stages = self._made_stages()
        if element is not None:
            if hasattr(self._module, "_quaternions"):
                element[:4] /= np.sqrt(element[:4] @ element[:4])
            self.turn_from(element)

    def _values(self) -> Any:
        return self._module._values(dict(self._parameters))

    def element(self) -> Floats:
        """See `Session`."""
        if self._turned is None:
            return np.empty(0)
        turned = self._turned
        elapsed = self._now() - turned.begun
        return np.array(self._module._attitude(turned.first, turned.element, turned.rate, elapsed)[0])

    def turn_from(self, first: Floats | None) -> None:
        """Follow the attitude, from an element at the present state; None for the identity."""
        values, still = self._values(), self._module._identity(1)
        gauge = None if self._gauge is None else np.broadcast_to(self._gauge, (1, len(self._module.GAUGE)))
        rate = self._module._rates(values, self._x, gauge)
        begun = still if first is None else first[np.newaxis]
        self._turned = Turned(begun, self._now(), still, np.zeros_like(still), rate)

    def advance(self, h: float, steps: int) -> None:
        """See `Session`."""
        self._prepare(h)
        with np.errstate(all="ignore"):
            for _ in range(steps):
                self._commit(*self._tried())

    def advance_along(self, h: float, increments: Floats) -> None:
        """See `Session`."""
        self._prepare(h)
        with np.errstate(all="ignore"):
            for row in increments:
                self._commit(*self._tried(row))

    def advance_tangent(self, h: float) -> Floats:
        """See `Session`."""
        if not hasattr(self._module, "_tangent_stage"):
            raise MissingExtraError("step_tangent")
        self._prepare(h)
        tangent = np.eye(self._x.shape[1])
        with np.errstate(all="ignore"):
            x, carry, memory, stages = self._tried()
            for arguments in stages:
                stage, found = self._module._tangent_stage(*arguments)
                if not (found.all() and np.isfinite(stage).all()):
                    raise BackendError("NO_CONVERGENCE", self.steps, self._x.copy())
                tangent = stage[0] @ tangent
        self._commit(x, carry, memory, stages)
        return tangent

    def branch(self) -> NumpySession:
        """See `Session`."""
        own = self._module, self._parameters, self._x, self._carry, self._gauge, self._t, self._draws
        twin = NumpySession(*own)
        twin._counted, twin._passed = self._counted, self._passed
        twin.steps, twin._h, twin._stages, twin._memory = self.steps, self._h, self._stages, list(self._memory)
        twin._turned = self._turned
        return twin

    def saved(self) -> bytes:
        """See `Session`."""
        buffer = io.BytesIO()
        gauge = np.empty(0) if self._gauge is None else self._gauge
        memory = np.array(self._memory)
        clock: dict[str, Any] = {"t": self._t, "counted": self._counted, "h": self._h, "steps": self.steps}
        clock["draws"] = np.array([self._draws.seed, self._draws.member, self._draws.step], dtype=np.uint64)
        clock["passed"] = np.array(self._passed)
        turned = {} if self._turned is None else self._turned.arrays()
        arrays = {"x": self._x, "carry": self._carry, "memory": memory, "gauge": gauge, **turned}
        np.savez(buffer, allow_pickle=False, **arrays, **clock)
        return buffer.getvalue()

    @classmethod
    def from_bytes(cls, module: Any, parameters: Mapping[str, float], saved: bytes) -> NumpySession:
        """The session whose `saved` bytes these are."""
        with np.load(io.BytesIO(saved)) as stored:
            gauge = stored["gauge"] if stored["gauge"].size else None
            draws = Draws(*stored["draws"].tolist())
            session = cls(module, parameters, stored["x"], stored["carry"], gauge, draws=draws)
            session.steps = int(stored["steps"])
            session._turned = Turned.from_arrays(stored) if "first" in stored else None
            if np.isfinite(stored["h"]):
                session._prepare(float(stored["h"]))
                session._memory = [(pair[0], pair[1]) for pair in stored["memory"]]
            session._t, session._counted = float(stored["t"]), int(stored["counted"])
            session._passed = (stored["passed"][0], stored["passed"][1])
        return session

    def _now(self) -> float:
        """The time of the state."""
        return self._t + (self.steps - self._counted) * self._h if self.steps > self._counted else self._t

    def _prepare(self, h: float) -> None:
        if h != self._h:
            self._t, self._counted = self._now(), self.steps
            self._h = h
            self._stages = self._made_stages()
            self._memory = [(np.zeros_like(self._x),) * 2] * len(self._stages)

    def _made_stages(self) -> list[Stage]:
        with np.errstate(all="ignore"):
            stages: list[Stage] = self._module._coefficients(self._values(), self._x, self._h, self._gauge)
            return stages

    def _of_step(self, increments: Floats | None) -> tuple[Any, ...]:
        """What stages of the next step depend on: its time, its size, and the noise, random or that given."""
        if not hasattr(self._module, "_drawing"):
            return self._now(), self._h
        draws, given = self._draws, None if increments is None else increments[np.newaxis]
        drawn = self._module._drawing(self._h, 1, draws.seed, draws.member, draws.step, given)
        return self._now(), self._h, drawn(0 if increments is not None else self.steps)

    def _tried(self, increments: Floats | None = None) -> tuple[Floats, Floats, list[Pair], list[Made]]:
        """State, carry and memory after one step, and of each stage: itself, its start and what it solved for."""
        x, carry, memory, stages = self._x, self._carry, list(self._memory), []
        own = self._of_step(increments) if self._renewed else ()
        for k, prepared in enumerate(self._stages):
            stage = self._module._renewed(prepared, *own) if own else prepared
            before = stage, x, carry
            x, carry, memory[k], status = self._module._advance(stage, x, carry, memory[k])
            if status[0] != "":
                raise BackendError(str(status[0]), self.steps, self._x.copy())
            stages.append((*before, memory[k][0]))
        return x, carry, memory, stages

    def _commit(self, x: Floats, carry: Floats, memory: list[Pair], stages: list[Made]) -> None:
        if hasattr(self._module, "_time_of"):
            passed = self._passed
            for stage, start, _, value in stages:
                elapsed = self._module._time_of(stage, start, value)
                if np.isnan(elapsed[0]):
                    raise BackendError("NOT_FINITE", self.steps, self._x.copy())
                passed = self._module._sum(*passed, elapsed)
            self._passed = passed
        if self._turned is not None:
            element, lost = self._turned.element, self._turned.lost
            for made in stages:
                element, lost = self._module._turn_stage(*made, element, lost)
            self._turned = self._turned._replace(element=element, lost=lost)
        self._x, self._carry, self._memory = x, carry, memory
        self.steps += 1


class NumpySolver:
    """The back end over a generated module, loaded from its text; needs no compiler, and makes an ensemble one call."""

    target = "numpy"

    def __init__(self, source: str, interface: Interface, gauge: Floats | None = None) -> None:
        self.interface = interface
        self.module: Any = load_module(source, interface.name)
        self._source, self._gauge = source, gauge

    def __reduce__(self) -> tuple[type[NumpySolver], tuple[Any, ...]]:
        return NumpySolver, (self._source, self.interface, self._gauge)

    def with_gauge(self, gauge: Floats) -> NumpySolver:
        """See `phigen.runtime.backend.Backend`."""
        return NumpySolver(self._source, self.interface, gauge)

    @property
    def identity(self) -> str:
        """See `phigen.runtime.backend.Backend`."""
        return str(self.module.__file__)

    def start(
        self,
        x0: Floats,
        parameters: Mapping[str, float],
        t0: float = 0.0,
        first: Floats | None = None,
        draws: Draws = FIRST_DRAWS,
    ) -> NumpySession:
        """See `phigen.runtime.backend.Backend`."""
        x = x0[np.newaxis].copy()
        self._expect_admissible(x, parameters)
        gauge = self._gauge
        if gauge is None and self.module.GAUGE:
            gauge = self.module.gauge(x0, **parameters)
        session = NumpySession(self.module, parameters, x, np.zeros_like(x), gauge, t0, draws)
        if self.interface.attitude:
            session.turn_from(first)
        return session

    def restored(self, saved: bytes, parameters: Mapping[str, float]) -> NumpySession:
        """See `phigen.runtime.backend.Backend`."""
        return NumpySession.from_bytes(self.module, parameters, saved)

    def ensemble(self, members: Members, threads: int | None = None, turned: Floats | None = None) -> Floats:
        """See `phigen.runtime.backend.Backend`; in one thread."""
        self._expect_admissible(members.x0, members.parameters)
        return ensemble(self.module, members, self._gauges(members.x0, members.parameters), turned)

    def pullback(self, members: Members, bars: Floats, threads: int | None = None) -> tuple[Floats, Floats, Floats]:
        """See `phigen.runtime.backend.Backend`."""
        if not hasattr(self.module, "pullback"):
            raise MissingExtraError("pullback")
        x0, own = members.x0, members.parameters
        self._expect_admissible(x0, own)
        if not len(members):
            return np.empty_like(bars), np.empty_like(x0), np.empty((len(self.interface.parameters), 0))
        options: dict[str, Any] = {"t0": members.t0} if self.interface.time else {}
        options |= {"gauge": self._gauge} if self._gauge is not None else {}
        try:
            given = x0, members.h, members.steps, bars, members.stride
            rows, x0_bar, found = self.module.pullback(*given, **options, **own)
        except self.module.StepError as error:
            raise BackendError(
                str(error.status), int(error.step), np.asarray(error.states)[-1], error.members
            ) from error
        slopes = [np.asarray(found[name], dtype=np.float64) for name in self.interface.parameters]
        return rows, x0_bar, np.array(slopes).reshape(len(slopes), len(x0))

    def _expect_admissible(self, x0: Floats, parameters: Mapping[str, Any]) -> None:
        values = self.module._values(parameters)
        refused = self.module._refused(values, x0) if hasattr(self.module, "_refused") else ()
        if len(refused) or not self.module._admissible(values):
            raise BackendError("BAD_ARGUMENT", 0, x0, tuple(refused) or tuple(range(len(x0))))

    def _gauges(self, x0: Floats, parameters: Mapping[str, Any]) -> Floats | None:
        """The gauge of each member, None where there is no gauge."""
        if not self.module.GAUGE:
            return None
        chosen = self.module.gauge(x0, **parameters) if self._gauge is None else self._gauge
        return np.broadcast_to(chosen, (len(x0), len(self.module.GAUGE)))

    def hamiltonian(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        """See `phigen.runtime.backend.Backend`."""
        when = () if t is None else (t,)
        return np.asarray(self.module.hamiltonian(x, *when, **parameters), dtype=np.float64)

    def casimirs(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        """See `phigen.runtime.backend.Backend`."""
        return np.asarray(self.module.casimirs(x, **parameters), dtype=np.float64)

    def vector_field(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        """See `phigen.runtime.backend.Backend`."""
        when = () if t is None else (t,)
        return np.asarray(self.module.vector_field(x, *when, **parameters), dtype=np.float64)

    def observables(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        """See `phigen.runtime.backend.Backend`."""
        if not self.interface.observables:
            return np.empty((len(x), 0))
        when = () if t is None else (t,)
        return np.asarray(self.module.observables(x, *when, **parameters), dtype=np.float64)

    def noise_fields(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        """See `phigen.runtime.backend.Backend`."""
        when = () if t is None else (t,)
        return np.asarray(self.module.noise_fields(x, *when, **parameters), dtype=np.float64)

    def rate(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        """See `phigen.runtime.backend.Backend`."""
        found: Floats = self.module._monitor(self.module._values(parameters), x)[:, 0]
        return found


def load(files: Mapping[str, str], interface: Interface) -> NumpySolver | NumpyLattice:
    """The back end of generated files; see `phigen.registry`."""
    if isinstance(interface, LatticeInterface):
        return NumpyLattice(files, interface)
    return NumpySolver(files[f"{interface.name}.py"], interface)
