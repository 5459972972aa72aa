"""Loaded solver in C: a shared library, called through ctypes.

Besides the documented functions, this module calls ``size_t NAME_solver_size(void)`` and ``size_t
NAME_solver_steps_done(const NAME_solver *)``, the number of successful steps since ``NAME_init``. With a monitor it
also calls ``double NAME_solver_time(const NAME_solver *)``, the physical time since ``NAME_init``.

The solver's struct is copied and stored as bytes. Its first field is the state ``x[DIM]``, of double or float. This
module reads no other field.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phigen.runtime import cache
from phigen.runtime.c_functions import functions_of
from phigen.runtime.c_lattice import CLattice
from phigen.runtime.c_session import Bytes, Cotangents, CSession, Real, aligned, aligned_copy
from phigen.runtime.gradients import MAX_TAPE_VALUES, Segment, segments
from phigen.runtime.interface import (
    FIRST_DRAWS,
    BackendError,
    Draws,
    Floats,
    Interface,
    LatticeInterface,
    MissingExtraError,
    status_name,
)
from phigen.runtime.members import Members, one_by_one, shared_out


class CSolver:
    """Solver that calls the shared library of generated C files (name → text); it is a
    `phigen.runtime.backend.Backend`.

    The object has no state of a trajectory, so several threads may use it. The library is taken from the cache or, if
    it is not there, compiled. Raises `ToolchainError` if the library cannot be compiled or loaded.
    """

    target = "c"

    def __init__(self, files: Mapping[str, str], interface: Interface, gauge: Floats | None = None) -> None:
        self.interface = interface
        self._real: Real = np.float32 if interface.single else np.float64
        self._files, self._library, self._gauge = dict(files), cache.load(files), gauge
        self._c = functions_of(self._library, interface)

    def __reduce__(self) -> tuple[type[CSolver], tuple[Any, ...]]:
        return CSolver, (self._files, self.interface, self._gauge)

    def with_gauge(self, gauge: Floats) -> CSolver:
        return CSolver(self._files, self.interface, np.ascontiguousarray(gauge, dtype=self._real))

    @property
    def identity(self) -> str:
        return cache.key_of(self._library)

    def start(
        self,
        x0: Floats,
        parameters: Mapping[str, float],
        t0: float = 0.0,
        first: Floats | None = None,
        draws: Draws = FIRST_DRAWS,
    ) -> CSession:
        interface = self.interface
        session = CSession(self._c, aligned(self._c.solver_size()), interface.dimension, interface.element, self._real)
        packed, start = self._packed(parameters), self._own(x0)
        if interface.time:
            status = self._c.init_at(session.address, packed.ctypes.data, start.ctypes.data, t0)
        elif self._gauge is None:
            status = self._c.init(session.address, packed.ctypes.data, start.ctypes.data)
        else:
            gauge = self._gauge.ctypes.data
            status = self._c.init_gauge(session.address, packed.ctypes.data, start.ctypes.data, gauge)
        if status == 0 and first is not None:
            element = self._own(first)
            position_address = element[math.prod(interface.attitude) :].ctypes.data if interface.position else None
            status = self._c.set_attitude(session.address, element.ctypes.data, position_address)
        if status == 0 and interface.noise:
            status = self._c.set_noise(session.address, draws.seed, draws.member, draws.step)
        if status:
            raise BackendError(status_name(status), 0, start.reshape(1, -1))
        return session

    def restored(self, saved: bytes, parameters: Mapping[str, float]) -> CSession:
        """Return the session from its saved bytes; see `phigen.runtime.backend.Backend.restored`.

        ``parameters`` is not used, since the bytes contain the parameters.
        """
        if len(saved) != self._c.solver_size():
            raise ValueError(
                f"the saved session has {len(saved)} bytes, those of this solver have {self._c.solver_size()}"
            )
        struct, interface = aligned_copy(np.frombuffer(saved, dtype=np.uint8)), self.interface
        return CSession(self._c, struct, interface.dimension, interface.element, self._real)

    def ensemble(self, members: Members, threads: int | None = None, attitudes: Floats | None = None) -> Floats:
        if not self.has_ensemble:
            reason = "`without: [ensemble]` or `profile: certified`"
            raise TypeError(f"{self.interface.name} was compiled without ensembles, because of {reason}")
        if not len(members) and members.alike:
            self._expect_parameters(members)
        if attitudes is not None:
            return self._with_attitudes(members, threads, attitudes)
        are_identical = members.alike and not members.stride and self._gauge is None
        if not (are_identical or hasattr(self._c, "ensemble_each")):
            return one_by_one(self, members, threads)
        final, status = np.empty_like(members.x0, order="C"), np.zeros(len(members), dtype=np.uint8)
        frames = members.frames() if members.stride else None

        def make(part: slice) -> None:
            x = self._own(members.x0[part].T)  # the C expects x[DIM][members]
            if are_identical:
                self._alike(members.part(part), x, status[part])
            else:
                rows = None if frames is None else frames[1:, part]
                self._each(members.part(part), x, status[part], rows)
            final[part] = x.T

        shared_out(members, threads, make)
        failures = {int(m): status_name(int(status[m])) for m in np.flatnonzero(status)}
        if frames is not None and members.steps % members.stride:
            frames[-1] = np.where(status[:, np.newaxis] == 0, final, np.nan)
        return members.checked(final if frames is None else frames, failures)

    def _expect_parameters(self, members: Members) -> None:
        """Raise `BackendError` if no step is possible with the parameters. Called for ensembles without
        members.

        With a monitor g nothing is checked, since the sign of g depends on the initial state.
        """
        if hasattr(self._c, "monitor"):
            return
        _, parameters, t0 = members.numbers(0)
        packed, zeros = self._packed(parameters), np.zeros(self.interface.dimension, self._real)
        struct = aligned(self._c.solver_size())
        numbers = [struct.ctypes.data, packed.ctypes.data, zeros.ctypes.data]
        if hasattr(self._c, "init_gauge"):
            gauge = np.zeros(len(self.interface.casimirs), self._real)
            status = self._c.init_gauge(*numbers, gauge.ctypes.data)
        else:
            status = self._c.init_at(*numbers, t0) if self.interface.time else self._c.init(*numbers)
        if status:
            raise BackendError(status_name(status), 0, members.x0)

    def _alike(self, members: Members, x: Floats, status: Bytes) -> None:
        """Integrate the states ``x`` (DIM, members) in place, for members that have equal parameters, step sizes and
        times."""
        h, parameters, t0 = members.numbers(0)
        packed = self._packed(parameters)
        start, further_arguments = (
            (packed.ctypes.data, x.ctypes.data, x.shape[1]),
            (h, members.steps, status.ctypes.data),
        )
        begin = (t0,) if self.interface.time else ()
        if self.interface.noise:
            draws = members.draws.seed, int(members.paths[0]), members.draws.step
            self._c.ensemble_of(*start, *begin, *further_arguments[:2], *draws, further_arguments[2])
        elif begin:
            self._c.ensemble_at(*start, t0, *further_arguments)
        else:
            self._c.ensemble(*start, *further_arguments)

    def _each(self, members: Members, x: Floats, status: Bytes, rows: Floats | None) -> None:
        """Integrate the states ``x`` (DIM, members) in place; each member has its own parameters, step size and initial
        time.

        ``rows`` (frames, members, DIM) receives the states of the frames; None if there are no frames.
        """
        count = len(members)
        packed, began, h = self._packed_arguments(members)
        start = [packed.ctypes.data if members.parameters else None, x.ctypes.data, count]
        start += [None if a is None else a.ctypes.data for a in began]
        stride = members.stride or 1
        frames = None if rows is None else np.empty((members.steps // stride, *x.shape), self._real)
        frames_address = None if frames is None else frames.ctypes.data
        self._c.ensemble_each(*start, h.ctypes.data, members.steps, stride, frames_address, status.ctypes.data)
        if rows is not None and frames is not None:
            rows[: len(frames)] = frames.transpose(0, 2, 1)

    def _with_attitudes(self, members: Members, threads: int | None, attitudes: Floats) -> Floats:
        """Return the result of `ensemble`, and write the attitudes of the members into the array ``attitudes``."""
        count, row_count = len(members), members.steps // members.stride if members.stride else 0
        frames = members.frames() if members.stride else None
        final, last, status = members.x0.copy(), attitudes[0].copy(), np.zeros(count, dtype=np.uint8)

        def make(part: slice) -> None:
            part_members = members.part(part)
            x, element = (self._own(a[part].T) for a in (final, last))
            rows, elements = (np.empty((row_count, *a.shape), self._real) for a in (x, element))
            self._all_turned(part_members, (x, element), (rows, elements), status[part])
            final[part], last[part] = x.T, element.T
            if frames is not None:
                frames[1 : row_count + 1, part], attitudes[1 : row_count + 1, part] = (
                    a.transpose(0, 2, 1) for a in (rows, elements)
                )

        shared_out(members, threads, make)
        succeeded = status[:, np.newaxis] == 0
        if frames is None:
            attitudes[-1] = last
        elif members.steps % members.stride:
            frames[-1], attitudes[-1] = (np.where(succeeded, a, np.nan) for a in (final, last))
        failures = {int(m): status_name(int(status[m])) for m in np.flatnonzero(status)}
        return members.checked(final if frames is None else frames, failures)

    def _all_turned(
        self, members: Members, initial: tuple[Floats, Floats], rows: tuple[Floats, Floats], status: Bytes
    ) -> None:
        """Integrate members that have attitudes. Their states and attitudes are updated in place.

        ``initial`` are two arrays: the states (DIM, members) and the attitudes (components, members). ``rows`` are two
        arrays that receive the states and the attitudes of the frames.
        """
        packed, times_or_gauges, h = self._packed_arguments(members)
        start = [packed if members.parameters else None, *initial]
        draws = members.draws.seed, int(members.paths[0]), members.draws.step
        self._c.ensemble_attitudes(
            *(None if a is None else a.ctypes.data for a in start),
            len(members),
            *(None if a is None else a.ctypes.data for a in times_or_gauges),
            h.ctypes.data,
            members.steps,
            *(draws if self.interface.noise else ()),
            max(1, members.stride),
            *(a.ctypes.data if members.stride else None for a in rows),
            status.ctypes.data,
        )

    def _packed_arguments(self, members: Members) -> tuple[Floats, list[Floats | None], Floats]:
        """Return arguments of an ensemble for the C: parameters, times or gauges, and step sizes.

        The parameters are an array (members, parameters), the step sizes an array (members,). The second result is a
        list. If H depends on the time, the list contains the initial times (members,). Otherwise, if Casimirs are
        subtracted from H, the list contains the gauges, that is the multiples of Casimirs (members, Casimirs), or None
        if the C chooses the gauges. In all other cases the list is empty.
        """
        count, width = len(members), max(1, len(members.parameters))
        packed = np.empty((count, width))
        for k, value in enumerate(members.parameters.values()):
            packed[:, k] = value
        times_or_gauges: list[Floats | None] = []
        if self.interface.time:
            times_or_gauges = [self._own(np.full(count, members.t0))]
        elif hasattr(self._c, "init_gauge"):
            gauge = self._gauge
            times_or_gauges = [None if gauge is None else np.array(np.broadcast_to(gauge, (count, gauge.shape[-1])))]
        return self._own(packed), times_or_gauges, self._own(np.full(count, members.h))

    @property
    def has_ensemble(self) -> bool:
        return hasattr(self._c, "ensemble")

    @property
    def has_pullback(self) -> bool:
        return hasattr(self._c, "pullback")

    def pullback(self, members: Members, bars: Floats, threads: int | None = None) -> tuple[Floats, Floats, Floats]:
        if not self.has_pullback:
            raise MissingExtraError("pullback")
        count, together = len(members), self._can_batch_pullback(members)
        of_step = int(self._c.trail_size_each() if together else self._c.trail_size())
        pieces = segments(members.steps, members.stride, max(1, MAX_TAPE_VALUES // of_step))
        room = of_step * max((s.count for s in pieces), default=1)
        rows, x0_bar, parameters_bar = (
            np.empty_like(bars),
            np.empty_like(members.x0),
            np.zeros((len(members.parameters), count)),
        )
        status = np.zeros(count, dtype=np.uint8)

        def make(part: slice) -> None:
            tape = np.empty(room, self._real)
            if together:
                rows[:, part], x0_bar[part], parameters_bar[:, part] = self._all_pulled(
                    members.part(part), pieces, tape, bars[:, part], status[part]
                )
                return
            for m in range(count)[part]:
                h, parameters, t0 = members.numbers(m)
                try:
                    pulled = self._pulled(members.x0[m], h, pieces, tape, bars[:, m], parameters, t0)
                except BackendError as error:
                    raise BackendError(error.status, error.step, error.states, (m,)) from error
                rows[:, m], x0_bar[m], parameters_bar[:, m] = pulled

        shared_out(members, threads, make)
        for m in np.flatnonzero(status)[:1].tolist():
            raise BackendError(status_name(int(status[m])), 0, members.x0, (m,))
        return rows, x0_bar, parameters_bar

    def _can_batch_pullback(self, members: Members) -> bool:
        """Whether one call of C for each segment of a run can compute the derivatives of all members.

        If a run has several segments, H must not depend on the time, and no Casimirs may be subtracted from H. The
        reason is that each call sets the initial time and the multiples of Casimirs again, but they must not change
        during a run.
        """
        if not hasattr(self._c, "pullback_each"):
            return False
        holds_start_values = self.interface.time or hasattr(self._c, "init_gauge")
        return int(self._c.trail_size_each()) * members.steps <= MAX_TAPE_VALUES or (
            len(members) > 1 and not holds_start_values
        )

    def _all_pulled(
        self, members: Members, segments: Sequence[Segment], tape: Floats, bars: Floats, status: Bytes
    ) -> tuple[Floats, Floats, Floats]:
        """Return the result of `pullback` for one part of an ensemble.

        The run is divided into segments. One call of the C function processes one segment for all members of this part.
        """
        rows, (packed, times_or_gauges, h) = np.empty_like(bars), self._packed_arguments(members)
        parameters_bar, x_bar = np.zeros_like(packed), np.zeros_like(members.x0, dtype=self._real)
        parameters_address = packed.ctypes.data if members.parameters else None
        segment_starts = self._segment_starts(members, segments, status)
        for segment, x in zip(reversed(segments), reversed(segment_starts), strict=True):
            if status.any():
                break
            bars_at_ends = bars[segment.rows.start : segment.rows.stop] if segment.rows else np.zeros((1, *x.shape))
            row_bars = np.array(bars_at_ends.transpose(1, 0, 2), dtype=self._real, order="C")
            row_bars[:, -1] += x_bar
            segment_rows, x_bar = np.empty_like(row_bars), np.empty_like(x)
            addresses = (a.ctypes.data for a in (segment_rows, row_bars, x_bar, parameters_bar, tape, status))
            start = (
                parameters_address,
                x.ctypes.data,
                len(members),
                *(None if a is None else a.ctypes.data for a in times_or_gauges),
            )
            self._c.pullback_each(*start, h.ctypes.data, segment.count, max(1, segment.stride), *addresses)
            if segment.rows:
                rows[segment.rows.start : segment.rows.stop] = segment_rows.transpose(1, 0, 2)
        rows[0] = members.x0
        return rows, x_bar + bars[0], parameters_bar.T[: len(members.parameters)]

    def _segment_starts(self, members: Members, segments: Sequence[Segment], status: Bytes) -> list[Floats]:
        """Return the states of members (members, DIM) at the start of each segment of a run."""
        states = [self._own(members.x0)]
        for segment in segments[:-1]:
            x = np.array(states[-1].T, order="C")
            if not status.any():
                self._each(replace(members, steps=segment.count), x, status, None)
            states.append(self._own(x.T))
        return states[: len(segments)]

    def _pulled(
        self,
        x0: Floats,
        h: float,
        segments: Sequence[Segment],
        tape: Floats,
        bars: Floats,
        parameters: Mapping[str, float],
        t0: float,
    ) -> tuple[Floats, Floats, Floats]:
        """Return the result of `pullback` for one member of an ensemble.

        The segments of the run are processed in reverse order.
        """
        current, segment_sessions, rows = self.start(x0, parameters, t0), list[CSession](), np.empty_like(bars)
        for segment in segments:
            segment_sessions.append(current)
            if segment is not segments[-1]:
                current = current.branch()
                current.advance(h, segment.count)
        cotangents = Cotangents(*(np.zeros(n, self._real) for n in (len(x0), max(1, len(parameters)), 1)))
        for segment, session in zip(reversed(segments), reversed(segment_sessions), strict=True):
            row_bars = bars[segment.rows.start : segment.rows.stop] if segment.rows else np.zeros((1, len(x0)))
            row_bars = np.array(row_bars, dtype=self._real)
            row_bars[-1] += cotangents.state
            segment_rows = session.branch().pull_back(h, segment, tape, row_bars, cotangents)
            if segment.rows:
                rows[segment.rows.start : segment.rows.stop] = segment_rows
        rows[0] = x0
        cotangents.state[:] += bars[0]
        if hasattr(self._c, "level_bar") and self._gauge is None:
            packed, start = self._packed(parameters), self._own(x0)
            bar_addresses = (cotangents.level[0], cotangents.state.ctypes.data, cotangents.parameters.ctypes.data)
            self._c.level_bar(packed.ctypes.data, start.ctypes.data, *bar_addresses)
        return rows, cotangents.state, cotangents.parameters[: len(parameters)]

    def hamiltonian(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        packed, x = self._packed(parameters), self._own(x)
        rows = zip(*_times(t), _addresses(x), strict=True)
        return np.array([self._c.hamiltonian(packed.ctypes.data, *row) for row in rows], dtype=np.float64)

    def casimirs(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        result = np.empty((len(x), len(self.interface.casimirs)), self._real)
        return self._fill(self._c.casimirs, x, result, parameters) if self.interface.casimirs else result

    def vector_field(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        return self._fill(self._c.vector_field, x, np.empty(x.shape, self._real), parameters, t)

    def observables(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        result = np.empty((len(x), len(self.interface.observables)), self._real)
        return self._fill(self._c.observables, x, result, parameters, t) if self.interface.observables else result

    def noise_fields(self, x: Floats, parameters: Mapping[str, float], t: Floats | None = None) -> Floats:
        result = np.empty((len(x), len(self.interface.noise), x.shape[1]), self._real)
        return self._fill(self._c.noise_fields, x, result, parameters, t)

    def rate(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        packed, x = self._packed(parameters), self._own(x)
        return np.array([self._c.monitor(packed.ctypes.data, row) for row in _addresses(x)], dtype=np.float64)

    def _fill(
        self, function: Any, x: Floats, result: Floats, parameters: Mapping[str, float], t: Floats | None = None
    ) -> Floats:
        packed, x = self._packed(parameters), self._own(x)
        for row in zip(*_times(t), _addresses(x), _addresses(result), strict=True):
            function(packed.ctypes.data, *row)
        return result.astype(np.float64, copy=False)

    def _packed(self, parameters: Mapping[str, float]) -> Floats:
        # A C struct cannot be empty: without parameters it has one unused char. In this case the array has one zero, so
        # that it is not smaller than the struct.
        return self._own(np.array(list(parameters.values()) or [0.0]))

    def _own(self, values: Floats) -> NDArray[Any]:
        """Return a copy in the precision of the C. Values too large for single precision become infinite."""
        if not self.interface.single:
            return np.array(values, dtype=np.float64, order="C")
        with np.errstate(over="ignore"):
            return np.array(values, dtype=np.float32, order="C")


def _times(t: Floats | None) -> list[list[float]]:
    """Return a list that contains the list of the times ``t``, or an empty list if ``t`` is None.

    Callers pass the entries of the result to ``zip``.
    """
    return [] if t is None else [t.tolist()]


def _addresses(x: Floats) -> range:
    """Return the addresses of the rows of a contiguous array."""
    start, width = x.ctypes.data, math.prod(x.shape[1:]) * x.itemsize
    return range(start, start + len(x) * width, width)


def load(files: Mapping[str, str], interface: Interface) -> CSolver | CLattice:
    """Return the solver that runs generated C code; ``files`` maps file names to texts."""
    if isinstance(interface, LatticeInterface):
        return CLattice(files, interface)
    return CSolver(files, interface)
