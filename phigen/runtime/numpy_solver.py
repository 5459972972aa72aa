"""Solver and sessions in NumPy, which call the functions of a generated module.

Sessions call the functions from which the module's ``integrate`` is made: ``_values``, ``_admissible``,
``_coefficients`` and ``_advance``. Sessions also call ``_renewed`` if the Hamiltonian depends on the time,
``_tangent_stage`` to compute tangents, ``_time_of`` if there is a monitor, and further functions for attitudes.
Ensembles (`phigen.runtime.numpy_members`) call the same functions.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
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
#: Data of a stage of a step: coefficients, parameters, step size, and the time if H depends on the time. Functions of
#: the generated module make and read these data.
Stage = tuple[Any, ...]

#: A completed stage of a step: the data of the stage, the state and its compensation term before the stage, and the
#: solution of the equation of the stage.
CompletedStage = tuple[Stage, Floats, Floats, Floats]


class AttitudeState(NamedTuple):
    """Attitude of a session, as a product of group elements.

    ``first`` is the group element at the time ``begun``. ``element`` is the product of the increments of all steps
    since that time, and ``lost`` is the compensation term of this product. ``rate`` is the rotation per unit of time
    that is due to the Casimirs subtracted from H; None if no Casimirs are subtracted.
    """

    first: Floats
    begun: float
    element: Floats
    lost: Floats
    rate: Floats | None

    def arrays(self) -> dict[str, Any]:
        """Return the arrays, by name, that a session stores to save this attitude."""
        rate = np.empty(0) if self.rate is None else self.rate
        return {"first": self.first, "begun": self.begun, "element": self.element, "lost": self.lost, "rate": rate}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any]) -> AttitudeState:
        """Return the attitude from the arrays of a saved session; ``arrays`` maps their names to the arrays."""
        rate = arrays["rate"] if arrays["rate"].size else None
        return cls(arrays["first"], float(arrays["begun"]), arrays["element"], arrays["lost"], rate)


def _memory_name(stage: int, part: int) -> str:
    """Return the name of an array in saved sessions: the first (0) or second (1) array of the predictor of a stage."""
    return f"memory_{stage}_{part}"


class NumpySession:
    """A `phigen.runtime.session.Session` that makes its steps by calling functions of a generated NumPy module."""

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
        # Time and number of steps when the step size last changed. Later times are this time plus a multiple of h, so
        # rounding errors do not accumulate.
        self._t, self._counted = t0, 0
        self._module, self._parameters, self._gauge = module, parameters, gauge
        self._renewed = hasattr(module, "_renewed")
        self._x, self._carry = x, carry
        self._passed = (np.zeros(len(x)),) * 2  # with a monitor: time since the start, and its compensation term
        self._h = np.nan
        self._stages: list[Stage] = []
        self._memory: list[Pair] = []
        self._turned: AttitudeState | None = None

    def state(self) -> Floats:
        return np.array(self._x[0])

    @property
    def rounding(self) -> float:
        return float(np.finfo(float).eps)

    def time(self) -> float:
        return float((self._passed[0] + self._passed[1])[0]) if hasattr(self._module, "_time_of") else np.nan

    def placed(self, x: Floats) -> NumpySession:
        copy = self.branch()
        copy._x = x[np.newaxis].copy()
        return copy

    def place(self, x: Floats) -> None:
        self._stand(x[np.newaxis].copy(), np.zeros((1, len(x))))
        if hasattr(self._module, "_with_new_step"):
            self._memory = [(np.zeros_like(self._x),) * 2] * len(self._stages)

    def kick(self, change: Floats) -> None:
        self._stand(*self._module._sum(self._x, self._carry, change[np.newaxis]))
        if hasattr(self._module, "_with_new_step"):  # the last solution is used to predict the next one
            self._memory = [self._module._with_new_step(pair, 1.0) for pair in self._memory]

    def _stand(self, x: Floats, carry: Floats) -> None:
        """Replace the state and its compensation term. Predictors are not changed, since they are differences from the
        state.
        """
        monitored = hasattr(self._module, "_refused")
        if not np.isfinite(x).all() or (monitored and len(self._module._refused(self._values(), x))):
            raise BackendError("BAD_ARGUMENT", self.steps, self._x.copy())
        element = None if self._turned is None else self.element()
        self._x, self._carry = x, carry
        if monitored:  # then the function `gauge` returns the energy level e = −H
            self._gauge = self._module.gauge(x[0], **self._parameters)
            if np.isfinite(self._h):
                self._stages = self._new_stages()
        if element is not None:
            if hasattr(self._module, "_quaternions"):
                element[:4] /= np.sqrt(element[:4] @ element[:4])
            self.turn_from(element)

    def set_parameters(self, parameters: Mapping[str, float]) -> None:
        values = self._module._values(dict(parameters))
        monitored = hasattr(self._module, "_refused")
        if not self._module._admissible(values) or (monitored and len(self._module._refused(values, self._x))):
            raise BackendError("BAD_ARGUMENT", self.steps, self._x.copy())
        element = None if self._turned is None else self.element()
        self._t, self._counted = self._now(), self.steps
        self._parameters = dict(parameters)
        if monitored:  # then the function `gauge` returns the energy level e = −H
            self._gauge = self._module.gauge(self._x[0], **self._parameters)
        self._h, self._stages, self._memory = np.nan, [], []
        if element is not None:
            self.turn_from(element)

    def _values(self) -> Any:
        return self._module._values(dict(self._parameters))

    def element(self) -> Floats:
        if self._turned is None:
            return np.empty(0)
        attitude = self._turned
        elapsed = self._now() - attitude.begun
        return np.array(self._module._attitude(attitude.first, attitude.element, attitude.rate, elapsed)[0])

    def turn_from(self, first: Floats | None) -> None:
        """Set the attitude at the present state to the group element ``first``; None stands for the identity."""
        values, identity = self._values(), self._module._identity(1)
        gauge = None if self._gauge is None else np.broadcast_to(self._gauge, (1, len(self._module.GAUGE)))
        rate = self._module._rates(values, self._x, gauge)
        initial = identity if first is None else first[np.newaxis]
        self._turned = AttitudeState(initial, self._now(), identity, np.zeros_like(identity), rate)

    def advance(self, h: float, steps: int) -> None:
        self._prepare(h)
        with np.errstate(all="ignore"):
            if hasattr(self._module, "_followed") and steps:
                self._run_corrected(steps)
            else:
                self._make(steps)

    def _make(self, steps: int) -> None:
        for _ in range(steps):
            self._commit(*self._attempted_step())

    def _run_corrected(self, steps: int) -> None:
        """Apply the inverse corrector of the method, make steps, then apply the corrector.

        If no step succeeds, or if the corrector or its inverse fails, the state is unchanged.
        """
        start, status = (self._x, self._carry, self.steps), ""
        try:
            self._follow("BEGIN")
            self._make(steps)
        except BackendError as error:
            status = error.status
        if self.steps > start[2]:
            try:
                self._follow("END")
            except BackendError as error:
                self._x, self._carry, self.steps = start
                status = status or error.status
        else:
            self._x, self._carry, _ = start
        if status:
            raise BackendError(status, self.steps, self._x.copy())

    def _follow(self, flows: str) -> None:
        """Apply the corrector of the method, or its inverse, to the state.

        ``flows`` is "BEGIN" for the inverse, which is applied before the first step, and "END" for the corrector, which
        is applied after the last step. These are the names of lists of flows in the generated module.
        """
        x, carry = self._module._followed(getattr(self._module, flows), self._stages[0], self._x, self._carry)
        if not np.isfinite(x).all():
            raise BackendError("NOT_FINITE", self.steps, self._x.copy())
        self._x, self._carry = x, carry

    def advance_along(self, h: float, increments: Floats) -> None:
        self._prepare(h)
        with np.errstate(all="ignore"):
            for row in increments:
                self._commit(*self._attempted_step(row))

    def advance_tangent(self, h: float) -> Floats:
        if not hasattr(self._module, "_tangent_stage"):
            raise MissingExtraError("step_tangent")
        self._prepare(h)
        tangent = np.eye(self._x.shape[1])
        with np.errstate(all="ignore"):
            x, carry, memory, stages = self._attempted_step()
            for arguments in stages:
                stage, converged = self._module._tangent_stage(*arguments)
                if not (converged.all() and np.isfinite(stage).all()):
                    raise BackendError("NO_CONVERGENCE", self.steps, self._x.copy())
                tangent = stage[0] @ tangent
        if hasattr(self._module, "_followed"):
            self.advance(h, 1)  # repeats the step between the inverse corrector and the corrector
        else:
            self._commit(x, carry, memory, stages)
        return tangent

    def interpolated(self, fractions: Sequence[float]) -> Floats | None:
        if not hasattr(self._module, "_interpolated") or not self._memory or self._memory[0][1].ndim != 3:
            return None
        with np.errstate(all="ignore"):
            states: Floats = self._module._interpolated(
                self._stages[0], self._x, self._memory[0][1], np.asarray(fractions)
            )
        return states

    def branch(self) -> NumpySession:
        state = self._x, self._carry, self._gauge, self._t, self._draws
        twin = NumpySession(self._module, self._parameters, *state)
        twin._counted, twin._passed = self._counted, self._passed
        twin.steps, twin._h, twin._stages, twin._memory = self.steps, self._h, self._stages, list(self._memory)
        twin._turned = self._turned
        return twin

    def saved(self) -> bytes:
        buffer = io.BytesIO()
        gauge = np.empty(0) if self._gauge is None else self._gauge
        memory = {_memory_name(k, j): part for k, pair in enumerate(self._memory) for j, part in enumerate(pair)}
        clock: dict[str, Any] = {"t": self._t, "counted": self._counted, "h": self._h, "steps": self.steps}
        clock["draws"] = np.array([self._draws.seed, self._draws.member, self._draws.step], dtype=np.uint64)
        clock["passed"] = np.array(self._passed)
        attitude_arrays = {} if self._turned is None else self._turned.arrays()
        arrays = {"x": self._x, "carry": self._carry, "gauge": gauge, **memory, **attitude_arrays}
        np.savez(buffer, allow_pickle=False, **arrays, **clock)
        return buffer.getvalue()

    @classmethod
    def from_bytes(cls, module: Any, parameters: Mapping[str, float], content: bytes) -> NumpySession:
        """Return the session from the bytes ``content``, which the method `saved` of the session returned."""
        with np.load(io.BytesIO(content)) as archive:
            gauge = archive["gauge"] if archive["gauge"].size else None
            draws = Draws(*archive["draws"].tolist())
            session = cls(module, parameters, archive["x"], archive["carry"], gauge, draws=draws)
            session.steps = int(archive["steps"])
            session._turned = AttitudeState.from_arrays(archive) if "first" in archive else None
            if np.isfinite(archive["h"]):
                session._prepare(float(archive["h"]))
                session._memory = [
                    (archive[_memory_name(k, 0)], archive[_memory_name(k, 1)]) for k in range(len(session._stages))
                ]
            session._t, session._counted = float(archive["t"]), int(archive["counted"])
            session._passed = (archive["passed"][0], archive["passed"][1])
        return session

    def _now(self) -> float:
        """Return the physical time of the present state; not used with a monitor, which rescales time."""
        return self._t + (self.steps - self._counted) * self._h if self.steps > self._counted else self._t

    def _prepare(self, h: float) -> None:
        if h != self._h:
            self._t, self._counted = self._now(), self.steps
            ratio, self._h = h / self._h, h
            self._stages = self._new_stages()
            if self._memory and hasattr(self._module, "_with_new_step"):
                self._memory = [self._module._with_new_step(pair, ratio) for pair in self._memory]
            else:
                self._memory = [(np.zeros_like(self._x),) * 2] * len(self._stages)

    def _new_stages(self) -> list[Stage]:
        with np.errstate(all="ignore"):
            stages: list[Stage] = self._module._coefficients(self._values(), self._x, self._h, self._gauge)
            return stages

    def _of_step(self, increments: Floats | None) -> tuple[Any, ...]:
        """Return arguments for the stages of the next step: time, step size and, if the system has noise, its
        increments.

        The increments are ``increments`` or, if this is None, random numbers.
        """
        if not hasattr(self._module, "_drawing"):
            return self._now(), self._h
        draws, prescribed = self._draws, None if increments is None else increments[np.newaxis]
        noise = self._module._drawing(self._h, 1, draws.seed, draws.member, draws.step, prescribed)
        return self._now(), self._h, noise(0 if increments is not None else self.steps)

    def _attempted_step(
        self, increments: Floats | None = None
    ) -> tuple[Floats, Floats, list[Pair], list[CompletedStage]]:
        """Compute one step without changing the session. Return state, compensation term, predictors, and completed
        stages.

        Raises `BackendError`.
        """
        x, carry, memory, stages = self._x, self._carry, list(self._memory), []
        of_step = self._of_step(increments) if self._renewed else ()
        for k, prepared in enumerate(self._stages):
            stage = self._module._renewed(prepared, *of_step) if of_step else prepared
            stage_before = stage, x, carry
            x, carry, memory[k], status = self._module._advance(stage, x, carry, memory[k])
            if status[0] != "":
                raise BackendError(str(status[0]), self.steps, self._x.copy())
            stages.append((*stage_before, memory[k][0]))
        return x, carry, memory, stages

    def _commit(self, x: Floats, carry: Floats, memory: list[Pair], stages: list[CompletedStage]) -> None:
        if hasattr(self._module, "_time_of"):
            passed_time = self._passed
            for stage, start, _, value in stages:
                elapsed = self._module._time_of(stage, start, value)
                if np.isnan(elapsed[0]):
                    raise BackendError("NOT_FINITE", self.steps, self._x.copy())
                passed_time = self._module._sum(*passed_time, elapsed)
            self._passed = passed_time
        if self._turned is not None:
            element, compensation = self._turned.element, self._turned.lost
            for completed in stages:
                element, compensation = self._module._turn_stage(*completed, element, compensation)
            self._turned = self._turned._replace(element=element, lost=compensation)
        self._x, self._carry, self._memory = x, carry, memory
        self.steps += 1


class NumpySolver:
    """Loaded solver in NumPy, made from the text of a generated module: a `phigen.runtime.backend.Backend`.

    This solver needs no compiler, and makes the steps of all members of an ensemble together.
    """

    target = "numpy"

    def __init__(self, source: str, interface: Interface, gauge: Floats | None = None) -> None:
        self.interface = interface
        self.module: Any = load_module(source, interface.name)
        self._source, self._gauge = source, gauge

    def __reduce__(self) -> tuple[type[NumpySolver], tuple[Any, ...]]:
        return NumpySolver, (self._source, self.interface, self._gauge)

    def with_gauge(self, gauge: Floats) -> NumpySolver:
        return NumpySolver(self._source, self.interface, gauge)

    @property
    def identity(self) -> str:
        return str(self.module.__file__)

    def start(
        self,
        x0: Floats,
        parameters: Mapping[str, float],
        t0: float = 0.0,
        first: Floats | None = None,
        draws: Draws = FIRST_DRAWS,
    ) -> NumpySession:
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
        return NumpySession.from_bytes(self.module, parameters, saved)

    def ensemble(self, members: Members, threads: int | None = None, attitudes: Floats | None = None) -> Floats:
        """Integrate an ensemble as `phigen.runtime.backend.Backend.ensemble` says, in one thread."""
        return ensemble(self.module, members, self._gauges(members.x0, members.parameters), attitudes)

    @property
    def has_ensemble(self) -> bool:
        return True

    @property
    def has_pullback(self) -> bool:
        return hasattr(self.module, "pullback")

    def pullback(self, members: Members, bars: Floats, threads: int | None = None) -> tuple[Floats, Floats, Floats]:
        if not self.has_pullback:
            raise MissingExtraError("pullback")
        x0, parameters = members.x0, members.parameters
        self._expect_admissible(x0, parameters)
        if not len(members):
            return np.empty_like(bars), np.empty_like(x0), np.empty((len(self.interface.parameters), 0))
        options: dict[str, Any] = {"t0": members.t0} if self.interface.time else {}
        options |= {"gauge": self._gauge} if self._gauge is not None else {}
        try:
            start = x0, members.h, members.steps, bars, members.stride
            rows, x0_bar, parameter_bars = self.module.pullback(*start, **options, **parameters)
        except self.module.StepError as error:
            raise BackendError(
                str(error.status), int(error.step), np.asarray(error.states)[-1], error.members
            ) from error
        slopes = [np.asarray(parameter_bars[name], dtype=np.float64) for name in self.interface.parameters]
        return rows, x0_bar, np.array(slopes).reshape(len(slopes), len(x0))

    def _expect_admissible(self, x0: Floats, parameters: Mapping[str, Any]) -> None:
        values = self.module._values(parameters)
        refused = self.module._refused(values, x0) if hasattr(self.module, "_refused") else ()
        if len(refused) or not self.module._admissible(values):
            raise BackendError("BAD_ARGUMENT", 0, x0, tuple(refused) or tuple(range(len(x0))))

    def _gauges(self, x0: Floats, parameters: Mapping[str, Any]) -> Floats | None:
        """Return the multiples of Casimirs that are subtracted from H, as an array (members, Casimirs); None if there
        are none.
        """
        if not self.module.GAUGE:
            return None
        gauges = self.module.gauge(x0, **parameters) if self._gauge is None else self._gauge
        return np.broadcast_to(gauges, (len(x0), len(self.module.GAUGE)))

    def hamiltonian(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        time_arguments = () if t is None else (t,)
        return np.asarray(self.module.hamiltonian(x, *time_arguments, **parameters), dtype=np.float64)

    def casimirs(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        return np.asarray(self.module.casimirs(x, **parameters), dtype=np.float64)

    def vector_field(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        time_arguments = () if t is None else (t,)
        return np.asarray(self.module.vector_field(x, *time_arguments, **parameters), dtype=np.float64)

    def observables(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        if not self.interface.observables:
            return np.empty((len(x), 0))
        time_arguments = () if t is None else (t,)
        return np.asarray(self.module.observables(x, *time_arguments, **parameters), dtype=np.float64)

    def noise_fields(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        time_arguments = () if t is None else (t,)
        return np.asarray(self.module.noise_fields(x, *time_arguments, **parameters), dtype=np.float64)

    def rate(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        rates: Floats = self.module._monitor(self.module._values(parameters), x)[:, 0]
        return rates


def load(files: Mapping[str, str], interface: Interface) -> NumpySolver | NumpyLattice:
    """Return the solver that runs generated NumPy code; ``files`` maps file names to texts."""
    if isinstance(interface, LatticeInterface):
        return NumpyLattice(files, interface)
    return NumpySolver(files[f"{interface.name}.py"], interface)
