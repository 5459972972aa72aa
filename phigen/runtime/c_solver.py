"""A generated C solver, called through ctypes.

Beside the documented functions of the generated code, two small ones are used: ``size_t NAME_solver_size(void)``, and
``size_t NAME_solver_steps_done(const NAME_solver *)``, the good steps since ``NAME_init``. Of the solver's struct only
the first member, ``double x[DIM]``, is looked at.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np

from phigen.runtime import cache
from phigen.runtime.interface import BackendError, Floats, Interface, MissingExtraError, Progress, row_steps

#: Names of NAME_status, by value, without the prefix.
STATUSES = ("OK", "NO_CONVERGENCE", "SINGULAR", "NOT_FINITE", "BAD_ARGUMENT")

# Between two calls Python can deliver a keyboard interrupt.
_STEPS_PER_CALL = 1 << 16
_MEMBERS_PER_CALL = 1024  # a multiple of every vector width: members meet the same neighbours in each split
_REPORTS = 200
_ALIGNMENT = 64  # what the widest vector registers ask for

_POINTER, _DOUBLE, _SIZE, _INT = ctypes.c_void_p, ctypes.c_double, ctypes.c_size_t, ctypes.c_int
_SIGNATURES = {
    "solver_size": (_SIZE, ()),
    "solver_steps_done": (_SIZE, (_POINTER,)),
    "init": (_INT, (_POINTER, _POINTER, _POINTER)),
    "integrate": (_INT, (_POINTER, _DOUBLE, _SIZE)),
    "ensemble": (_INT, (_POINTER, _POINTER, _SIZE, _DOUBLE, _SIZE, _POINTER)),
    "hamiltonian": (_DOUBLE, (_POINTER, _POINTER)),
    "casimirs": (None, (_POINTER, _POINTER, _POINTER)),
    "vector_field": (None, (_POINTER, _POINTER, _POINTER)),
}


# What is there only if it was asked for.
_EXTRAS = {
    "step_tangent": (_INT, (_POINTER, _DOUBLE, _POINTER)),
    "init_gauge": (_INT, (_POINTER, _POINTER, _POINTER, _POINTER)),
}


class CSolver:
    """The back end over a shared library; it holds no state, so that threads may share it."""

    target = "c"

    def __init__(self, library: ctypes.CDLL, interface: Interface, gauge: Floats | None = None) -> None:
        self.interface = interface
        self._library, self._gauge = library, gauge
        self._c: Any = SimpleNamespace()
        offered = {name: s for name, s in _EXTRAS.items() if hasattr(library, f"{interface.name}_{name}")}
        for name, (result, arguments) in {**_SIGNATURES, **offered}.items():
            function = getattr(library, f"{interface.name}_{name}")
            function.restype, function.argtypes = result, arguments
            setattr(self._c, name, function)

    def with_gauge(self, gauge: Floats) -> CSolver:
        """See `phigen.runtime.interface.Backend`."""
        return CSolver(self._library, self.interface, np.ascontiguousarray(gauge, dtype=np.float64))

    @classmethod
    def compile(cls, files: Mapping[str, str], interface: Interface) -> CSolver:
        """Compile generated files (name → text), or take them from the cache; raises `ToolchainError`."""
        return cls(cache.load(files), interface)

    def integrate(
        self, x0: Floats, h: float, steps: int, stride: int, parameters: Mapping[str, float], progress: Progress | None
    ) -> Floats:
        """See `phigen.runtime.interface.Backend`."""
        marks = row_steps(steps, stride)
        states = np.empty((len(marks), self.interface.dimension))
        states[0] = x0
        solver, x = self._initialised(x0, parameters)
        report_every = max(1, steps // _REPORTS)
        done = reported = 0
        for row, mark in enumerate(marks.tolist()[1:], start=1):
            while done < mark:
                chunk = min(mark - done, _STEPS_PER_CALL)
                status = self._c.integrate(solver, h, chunk)
                if status:
                    good = self._c.solver_steps_done(solver)
                    raise BackendError(_status(status), good, _rows_so_far(states, marks, good, x))
                done += chunk
                if progress and (done - reported >= report_every or done == steps):
                    reported = done
                    progress(done)
            states[row] = x
        return states

    def ensemble(self, x0: Floats, h: float, steps: int, parameters: Mapping[str, float]) -> Floats:
        """See `phigen.runtime.interface.Backend`."""
        packed = self._packed(parameters)
        final, status = np.empty_like(x0, order="C"), np.zeros(len(x0), dtype=np.uint8)
        overall = 0
        chunk = max(_MEMBERS_PER_CALL, _STEPS_PER_CALL // max(steps, 1) // _MEMBERS_PER_CALL * _MEMBERS_PER_CALL)
        for start in range(0, len(x0), chunk):
            part = slice(start, start + chunk)
            x = np.array(x0[part].T, order="C")  # x[DIM][members]
            failure = self._c.ensemble(
                packed.ctypes.data, x.ctypes.data, x.shape[1], h, steps, status[part].ctypes.data
            )
            overall = overall or failure
            final[part] = x.T
        if overall or status.any():
            failed = tuple(np.flatnonzero(status).tolist())
            first = int(status[failed[0]]) if failed else overall
            raise BackendError(_status(first), -1, final, failed)
        return final

    def step_tangent(self, x: Floats, h: float, parameters: Mapping[str, float]) -> tuple[Floats, Floats]:
        """See `phigen.runtime.interface.Backend`."""
        if not hasattr(self._c, "step_tangent"):
            raise MissingExtraError("step_tangent")
        solver, state = self._initialised(x, parameters)
        tangent = np.empty((len(x), len(x)))
        status = self._c.step_tangent(solver, h, tangent.ctypes.data)
        if status:
            raise BackendError(_status(status), 0, x.reshape(1, -1))
        return state.copy(), tangent

    def hamiltonian(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        """See `phigen.runtime.interface.Backend`."""
        packed, x = self._packed(parameters), np.ascontiguousarray(x)
        return np.array([self._c.hamiltonian(packed.ctypes.data, row) for row in _addresses(x)], dtype=np.float64)

    def casimirs(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        """See `phigen.runtime.interface.Backend`."""
        out = np.empty((len(x), len(self.interface.casimirs)))
        return self._fill(self._c.casimirs, x, out, parameters) if self.interface.casimirs else out

    def vector_field(self, x: Floats, parameters: Mapping[str, float]) -> Floats:
        """See `phigen.runtime.interface.Backend`."""
        return self._fill(self._c.vector_field, x, np.empty_like(x, order="C"), parameters)

    def _fill(self, function: Any, x: Floats, out: Floats, parameters: Mapping[str, float]) -> Floats:
        packed, x = self._packed(parameters), np.ascontiguousarray(x)
        for source, target in zip(_addresses(x), _addresses(out), strict=True):
            function(packed.ctypes.data, source, target)
        return out

    def _initialised(self, x0: Floats, parameters: Mapping[str, float]) -> tuple[ctypes.c_void_p, Floats]:
        """A solver at x0, and a view of its state."""
        size = self._c.solver_size()
        memory = np.zeros(size + _ALIGNMENT, dtype=np.uint8)
        start = -memory.ctypes.data % _ALIGNMENT
        struct = memory[start : start + size]
        packed, first = self._packed(parameters), np.ascontiguousarray(x0, dtype=np.float64)
        address = ctypes.c_void_p(struct.ctypes.data)
        x = struct[: 8 * self.interface.dimension].view(np.float64)  # keeps the memory alive
        if self._gauge is None:
            status = self._c.init(address, packed.ctypes.data, first.ctypes.data)
        else:
            gauge = self._gauge.ctypes.data
            status = self._c.init_gauge(address, packed.ctypes.data, first.ctypes.data, gauge)
        if status:
            raise BackendError(_status(status), 0, first.reshape(1, -1))
        return address, x

    def _packed(self, parameters: Mapping[str, float]) -> Floats:
        # A struct without parameters has one unused char, which the zero covers.
        return np.array(list(parameters.values()) or [0.0], dtype=np.float64)


def _addresses(x: Floats) -> range:
    """The addresses of the rows of a contiguous array."""
    start, width = x.ctypes.data, x.shape[1] * x.itemsize
    return range(start, start + len(x) * width, width)


def _rows_so_far(states: Floats, marks: np.ndarray[tuple[int], np.dtype[np.int64]], good: int, x: Floats) -> Floats:
    rows = states[marks <= good]
    return rows.copy() if good in marks else np.vstack([rows, x])


def _status(value: int) -> str:
    return STATUSES[value] if value < len(STATUSES) else f"STATUS_{value}"
