"""Sessions of a generated C solver; the state of each session is in a C struct NAME_solver."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from phigen.runtime.gradients import Segment
from phigen.runtime.interface import BackendError, Floats, MissingExtraError, status_name

Bytes = NDArray[np.uint8]
Real = Any  # np.float64, or np.float32 where the C computes in single precision

# Largest number of steps in one call of C. Python handles Ctrl-C only between two calls. For small systems a call takes
# milliseconds.
_STEPS_PER_CALL = 1 << 16
_ALIGNMENT = 64  # bytes: the width of the widest vector registers (AVX-512)


class Cotangents(NamedTuple):
    """Cotangents that a reverse pass updates: of the state, of the parameters and, with a monitor, of the energy level
    e.
    """

    state: Floats
    parameters: Floats
    level: Floats


class CSession:
    """A `phigen.runtime.session.Session` whose data are in a C struct NAME_solver.

    The struct contains no pointers, so a copy of its bytes is a copy of the session.
    """

    def __init__(
        self, functions: Any, struct: Bytes, dimension: int, element: int = 0, real: Real = np.float64
    ) -> None:
        self._c, self._struct, self._element, self._real = functions, struct, element, real
        self.address = ctypes.c_void_p(struct.ctypes.data)
        self._x = struct[: real().itemsize * dimension].view(real)

    @property
    def steps(self) -> int:
        return int(self._c.solver_steps_done(self.address))

    def state(self) -> Floats:
        return self._x.astype(np.float64)

    @property
    def rounding(self) -> float:
        return float(np.finfo(self._real).eps)

    def time(self) -> float:
        return float(self._c.solver_time(self.address)) if hasattr(self._c, "solver_time") else math.nan

    def advance(self, h: float, steps: int) -> None:
        while steps > 0:
            chunk = min(steps, _STEPS_PER_CALL)
            status = self._c.integrate(self.address, h, chunk)
            if status:
                raise BackendError(status_name(status), self.steps, self._x.reshape(1, -1).astype(np.float64))
            steps -= chunk

    def advance_along(self, h: float, increments: Floats) -> None:
        rows = np.ascontiguousarray(increments, dtype=self._real)
        status = self._c.integrate_along(self.address, h, len(rows), rows.ctypes.data)
        if status:
            raise BackendError(status_name(status), self.steps, self._x.reshape(1, -1).astype(np.float64))

    def advance_tangent(self, h: float) -> Floats:
        if not hasattr(self._c, "step_tangent"):
            raise MissingExtraError("step_tangent")
        tangent = np.empty((len(self._x), len(self._x)), dtype=self._real)
        status = self._c.step_tangent(self.address, h, tangent.ctypes.data)
        if status:
            raise BackendError(status_name(status), self.steps, self._x.reshape(1, -1).astype(np.float64))
        return tangent.astype(np.float64, copy=False)

    def pull_back(self, h: float, segment: Segment, tape: Floats, bars: Floats, cotangents: Cotangents) -> Floats:
        """Compute the rows (rows, DIM) of a segment that begins at the current state, and the cotangents at its
        start.

        ``cotangents`` are overwritten: before the call they belong to the end of the segment, afterwards to its start.
        ``bars`` are the cotangents of the rows. ``tape`` is work space.
        """
        rows, level = np.empty_like(bars), (cotangents.level.ctypes.data,) * hasattr(self._c, "level_bar")
        out = (rows.ctypes.data, bars.ctypes.data, cotangents.state.ctypes.data, cotangents.parameters.ctypes.data)
        counts = (segment.count, segment.stride)
        status = self._c.pullback(self.address, h, *counts, *out, *level, tape.ctypes.data)
        if status:
            raise BackendError(status_name(status), segment.first, self._x.reshape(1, -1).astype(np.float64))
        return rows

    def interpolated(self, fractions: Sequence[float]) -> Floats | None:
        if not hasattr(self._c, "interpolate"):
            return None
        at = np.asarray(fractions, dtype=self._real)
        buffer = bytearray(len(at) * self._x.nbytes)
        place = (ctypes.c_char * len(buffer)).from_buffer(buffer)
        if self._c.interpolate(self.address, at.tobytes(), len(at), place):
            return None
        states: Floats = np.frombuffer(buffer, dtype=self._real).reshape(len(at), -1).astype(np.float64, copy=False)
        return states

    def branch(self) -> CSession:
        return CSession(self._c, aligned_copy(self._struct), len(self._x), self._element, self._real)

    def element(self) -> Floats:
        element = np.empty(self._element, dtype=self._real)
        if self._element:
            self._c.attitude(self.address, element.ctypes.data)
        return element.astype(np.float64, copy=False)

    def placed(self, x: Floats) -> CSession:
        copy = self.branch()
        copy._x[:] = x
        return copy

    def place(self, x: Floats) -> None:
        self._move("set_state", x)

    def kick(self, change: Floats) -> None:
        self._move("kick", change)

    def set_parameters(self, parameters: Mapping[str, float]) -> None:
        if parameters and not hasattr(self._c, "set_parameters"):
            raise TypeError("the solver was compiled without set_parameters: the spec has `without: [parameters]`")
        with np.errstate(over="ignore"):
            values = np.array(list(parameters.values()), dtype=self._real)
        status = self._c.set_parameters(self.address, values.ctypes.data) if parameters else 0
        if status:
            raise BackendError(status_name(status), self.steps, self._x.reshape(1, -1).astype(np.float64))

    def _move(self, function: str, by: Floats) -> None:
        if not hasattr(self._c, function):
            raise TypeError("the solver was compiled without kicks: the spec has without: [kicks]")
        with np.errstate(over="ignore"):  # values beyond single precision become infinite, which C reports
            values = np.ascontiguousarray(by, dtype=self._real)
        status = getattr(self._c, function)(self.address, values.ctypes.data)
        if status:
            raise BackendError(status_name(status), self.steps, self._x.reshape(1, -1).astype(np.float64))

    def saved(self) -> bytes:
        return self._struct.tobytes()


def aligned(size: int) -> Bytes:
    """Return ``size`` zero bytes whose address is aligned for vector registers."""
    memory = np.zeros(size + _ALIGNMENT, dtype=np.uint8)
    start = -memory.ctypes.data % _ALIGNMENT
    return memory[start : start + size]


def aligned_copy(struct: Bytes) -> Bytes:
    """Return a copy of the bytes of a struct, at an address that is aligned for vector registers."""
    copy = aligned(len(struct))
    copy[:] = struct
    return copy
